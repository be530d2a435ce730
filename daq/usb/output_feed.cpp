#include "daq/usb/output_feed.h"

#include <algorithm>

#include "daq/usb/little_endian.h"

namespace ferrobench::daq::usb {

OutputFeed::OutputFeed(LevelSource& source, double level, std::uint64_t oversampling, TickOrder order,
                       ToCode to_code)
    : source_(source),
      oversampling_(oversampling),
      to_code_(std::move(to_code)),
      from_(level),
      to_(level),
      first_pending_(order == TickOrder::after_update),
      levels_{level},
      last_dropped_(level) {}

double OutputFeed::next_level(std::uint64_t wanted) {
  while (done_ == length_ && !over_) {
    const auto piece = source_.next(std::max<std::uint64_t>(1, wanted / oversampling_));
    over_ = piece.samples == 0;
    from_ = to_;
    if (over_) break;
    to_ = piece.level;
    rows_ += piece.samples;
    length_ = piece.samples * oversampling_;
    done_ = 0;
  }
  if (over_ && done_ == length_) return to_;
  ++done_;
  if (done_ == length_) return to_;
  return from_ + (to_ - from_) * (static_cast<double>(done_) / static_cast<double>(length_));
}

void OutputFeed::fill(std::span<std::byte> bytes) {
  for (std::size_t at = 0; at + 2 <= bytes.size(); at += 2) {
    double level = levels_.back();
    if (first_pending_) {
      first_pending_ = false;
    } else {
      level = next_level((bytes.size() - at) / 2);
      levels_.push_back(level);
    }
    store_le(to_code_(level), bytes.subspan(at, 2));
    ++filled_;
  }
}

void OutputFeed::drop(std::size_t ticks) {
  if (ticks == 0) return;
  dropped_ += ticks;
  last_dropped_ = levels_[dropped_ - 1];
  // The newest level stays: fill() goes on from it.
  if (dropped_ < fewest_dropped || 2 * dropped_ < levels_.size()) return;
  const auto gone = std::min(dropped_, levels_.size() - 1);
  levels_.erase(levels_.begin(), levels_.begin() + static_cast<std::ptrdiff_t>(gone));
  dropped_ -= gone;
}

}  // namespace ferrobench::daq::usb

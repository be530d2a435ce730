#include "server/engine/sink.h"

#include <filesystem>

#include "recordings/iso_time.h"

namespace ferrobench::server {

namespace {

constexpr std::chrono::seconds flush_interval{1};  // what a crash may cost
constexpr std::size_t gap_rows = 8192;             // written at a time

}  // namespace

Sink::Sink(const std::string& path, const recordings::Header& header, daq::Scaling scaling, Hub& hub,
           std::string run)
    : scaling_(std::move(scaling)), hub_(hub), run_(run), live_(hub, std::move(run)), path_(path) {
  writer_.emplace(path, header, scaling_.channels(), scaling_.columns());
}

template <class F>
void Sink::guarded(F&& write) {
  if (!failure_.empty()) return;
  try {
    write();
  } catch (const std::exception& error) {
    failure_ = std::string("the recording cannot be written: ") + error.what();
  }
}

void Sink::store(const recordings::Rows& rows) {
  guarded([&] { writer_->append(rows); });
  live_.add(rows);
  rows_ += rows.time.size();
}

void Sink::fill_gap(std::uint64_t until) {
  while (rows_ < until) store(scaling_.gap(rows_, std::min<std::uint64_t>(until - rows_, gap_rows)));
}

void Sink::take(const daq::SampleBlock& block) {
  if (block.rows > 0) {
    fill_gap(block.first_sample);
    store(scaling_.rows(block));
  }
  for (const auto& event : block.events) add_event(event);
  if (const auto now = std::chrono::steady_clock::now(); now - flushed_ > flush_interval) {
    guarded([&] { writer_->flush(); });
    flushed_ = now;
  }
}

void Sink::add_event(const recordings::Event& event) {
  guarded([&] { writer_->add_event(event); });
  hub_.publish("events", {{"run", run_},
                          {"time", recordings::iso_now()},
                          {"time_s", event.time},
                          {"kind", event.kind},
                          {"message", event.message}});
}

bool Sink::finish(const std::string& status, const std::string& reason,
                  std::span<const recordings::SegmentRow> segments,
                  const std::array<std::optional<double>, 5>& noise) {
  live_.finish();
  if (rows_ == 0) {
    writer_.reset();
    std::error_code ignored;
    std::filesystem::remove(path_, ignored);
    return false;
  }
  guarded([&] { writer_->finish(status, reason, segments, noise); });
  return true;
}

}  // namespace ferrobench::server

#include "daq/usb/watch.h"

#include <algorithm>
#include <cmath>

namespace ferrobench::daq::usb {

namespace {

std::string text_of(double value) {
  return nlohmann::json(value).dump();
}

}  // namespace

void Watch::Range::add(double value) {
  low = std::min(low, value);
  high = std::max(high, value);
}

Watch::Watch(const Inputs& inputs, const std::optional<MonitorCheck>& check, double rate)
    : inputs_(inputs),
      monitor_(check),
      window_(check ? 1 + static_cast<std::uint64_t>(std::ceil(check->delay * rate)) : 1) {}

std::string Watch::check(std::uint64_t first, std::span<const std::uint16_t> codes,
                         std::span<const double> levels) {
  if (auto found = check_marker(first, codes); !found.empty()) return found;
  return check_monitor(first, codes, levels);
}

std::string Watch::check_marker(std::uint64_t first, std::span<const std::uint16_t> codes) const {
  if (!inputs_.marker()) return {};
  const auto& marker = *inputs_.marker();
  const auto width = inputs_.width();
  const auto fits = [&](std::uint16_t code) {
    return code >= marker.lowest_code && code <= marker.highest_code;
  };
  for (std::size_t i = marker.position; i < codes.size(); i += width) {
    if (fits(codes[i])) continue;
    const auto begin = i - marker.position;
    std::string text = "the marker shows code " + std::to_string(codes[i]) + " instead of " +
                       std::to_string(marker.lowest_code) + " to " + std::to_string(marker.highest_code) +
                       " at tick " + std::to_string(first + begin / width);
    for (std::size_t other = 0; other < width; ++other)
      if (fits(codes[begin + other]))
        return text + ": its level stands at place " + std::to_string(other) + " of the scan instead of " +
               std::to_string(marker.position) + ", the channels are rotated";
    return text + ": the channels are out of order, or the marker's wire is off";
  }
  return {};
}

std::string Watch::check_monitor(std::uint64_t first, std::span<const std::uint16_t> codes,
                                 std::span<const double> levels) {
  if (!monitor_) return {};
  const auto& column = inputs_.columns().front().column;
  const auto width = inputs_.width();
  for (std::size_t i = 0; i < levels.size(); ++i) {
    if (in_window_ == 0) {
      if (first + i > 0) before_ = now_;
      now_ = {levels[i], levels[i]};
    }
    now_.add(levels[i]);
    in_window_ = (in_window_ + 1) % window_;
    const double measured = column.offset + column.gain * (static_cast<int>(codes[i * width]) - 32768);
    const double low = std::min(now_.low, before_ ? before_->low : now_.low) - monitor_->tolerance;
    const double high = std::max(now_.high, before_ ? before_->high : now_.high) + monitor_->tolerance;
    if (measured >= low && measured <= high) continue;
    return "the amplifier's monitor shows " + text_of(measured) + " V/m instead of " + text_of(low) + " to " +
           text_of(high) + " at tick " + std::to_string(first + i) +
           ": the amplifier is off or does not follow, or the channels are out of order";
  }
  return {};
}

}  // namespace ferrobench::daq::usb

#include "daq/guard/trips.h"

#include <algorithm>
#include <cmath>

namespace ferrobench::daq {

namespace {

int whole(double count) {
  return static_cast<int>(std::clamp(count, -32769.0, 32768.0));
}

std::string number(double value) {
  return nlohmann::json(value).dump();
}

}  // namespace

Trips::Trips(const Limits& limits, std::span<const recordings::RawColumn> columns)
    : columns_(columns.size()) {
  for (std::size_t i = 0; i < columns.size(); ++i) {
    const auto [channel, gain, offset] = columns[i];
    const double margin = limits.monitor_margin * (limits.field_max - limits.field_min);
    double min = 0, max = 0;
    if (channel == recordings::Channel::field) {
      min = limits.field_min - margin;
      max = limits.field_max + margin;
    } else if (channel == recordings::Channel::displacement) {
      min = limits.displacement_min;
      max = limits.displacement_max;
    } else if (channel == recordings::Channel::force) {
      min = limits.force_min;
      max = limits.force_max;
    } else {
      continue;
    }
    const double a = (min - offset) / gain;
    const double b = (max - offset) / gain;
    windows_.push_back({channel, i, gain, offset, min, max, whole(std::ceil(std::min(a, b))),
                        whole(std::floor(std::max(a, b)))});
  }
}

std::optional<std::string> Trips::violation(const SampleBlock& block) const {
  const auto told = [](const Window& w, double value) {
    const std::string unit(recordings::channel_unit(w.channel));
    return "measured " + std::string(recordings::channel_name(w.channel)) + " " + number(value) + " " + unit +
           " is outside " + number(w.min) + " to " + number(w.max) + " " + unit;
  };
  for (const auto& w : windows_) {
    int low = w.highest, high = w.lowest;
    for (std::size_t i = w.column; i < block.counts.size(); i += columns_) {
      low = std::min<int>(low, block.counts[i]);
      high = std::max<int>(high, block.counts[i]);
    }
    if (low >= w.lowest && high <= w.highest) continue;
    return told(w, w.offset + w.gain * (low < w.lowest ? low : high));
  }
  return std::nullopt;
}

}  // namespace ferrobench::daq

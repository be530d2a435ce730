#include "daq/guard/trips.h"

#include <algorithm>
#include <cmath>

namespace ferrobench::daq {

namespace {

constexpr double lowest_count = -32768, highest_count = 32767;
// A column on a grid over a sensor's table ends one count above the lowest.
constexpr int within_ends = 32766;
// Share of a sensor's range: an end so near to zero is where the specimen rests, and noise reaches it.
constexpr double at_rest = 0.05;

// The counts that a limit allows. One that lies beyond all counts allows each of them, or, where that end is
// watched, all but the last ones.
int lowest_allowed(double limit, bool watch_end) {
  const double count = std::ceil(limit);
  if (count < lowest_count && watch_end) return -within_ends;
  return static_cast<int>(std::clamp(count, lowest_count, highest_count + 1));
}
int highest_allowed(double limit, bool watch_end) {
  const double count = std::floor(limit);
  if (count > highest_count && watch_end) return within_ends;
  return static_cast<int>(std::clamp(count, lowest_count - 1, highest_count));
}

std::string number(double value) {
  return nlohmann::json(value).dump();
}

}  // namespace

Trips::Trips(const Limits& limits, std::span<const recordings::RawColumn> columns, bool measured)
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
    const double rest = at_rest * std::abs(gain) * (highest_count - lowest_count);
    const bool may_watch = measured && channel != recordings::Channel::field;
    const auto watched = [&, gain = gain, offset = offset](double end) {
      return may_watch && std::abs(gain * end + offset) > rest;
    };
    windows_.push_back({channel, i, gain, offset, min, max,
                        lowest_allowed(std::min(a, b), watched(lowest_count)),
                        highest_allowed(std::max(a, b), watched(highest_count))});
  }
}

std::optional<std::string> Trips::violation(const SampleBlock& block) const {
  const auto told = [](const Window& w, double value) {
    const std::string name(recordings::channel_name(w.channel)), unit(recordings::channel_unit(w.channel));
    const auto measured = "measured " + name + " " + number(value) + " " + unit;
    if (value < w.min || value > w.max)
      return measured + " is outside " + number(w.min) + " to " + number(w.max) + " " + unit;
    return measured + " is the end of its sensor's range, beyond which the limits of " + number(w.min) +
           " to " + number(w.max) + " " + unit +
           " cannot be watched: choose a wider range, or leave out a channel that is not needed";
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

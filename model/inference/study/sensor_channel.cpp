#include "model/inference/study/sensor_channel.h"

#include <cmath>

namespace ferrobench::model::inference {
namespace {

using recordings::Channel;

// Of the regression of what the other view misses on what changed: 1 where both see the same.
constexpr double least_slope_of_motion = 0.5;

// The index of a channel in a recording's channels.
std::optional<std::size_t> index_of(const BenchRecording& recording, Channel channel) {
  for (std::size_t c = 0; c < recording.channels.size(); ++c)
    if (recording.channels[c].channel == channel) return c;
  return std::nullopt;
}

// Calls `use` with the recording's place among the misses, its index in the bench, and the channel's.
template <class Use>
void for_each_recording(const Misses& of, Channel channel, Use&& use) {
  for (std::size_t i = 0; i < of.recordings.size(); ++i)
    if (const auto c = index_of(of.bench[of.recordings[i]], channel)) use(i, of.recordings[i], *c);
}

}  // namespace

std::optional<Channel> channel_of(Family sensor) {
  switch (sensor) {
    case Family::charge_sensor:
      return Channel::charge;
    case Family::displacement_sensor:
      return Channel::displacement;
    case Family::force_sensor:
      return Channel::force;
    default:
      return std::nullopt;
  }
}

ExcessTaken excess_taken(const Misses& of, Channel channel) {
  ExcessTaken out;
  for_each_recording(of, channel, [&](std::size_t i, std::size_t, std::size_t c) {
    out.before += excess_squares(of.before[i][c]);
    out.left += excess_squares(of.after[i][c]);
  });
  return out;
}

double squares_of_change(const Misses& of, Channel channel) {
  double out = 0;
  for_each_recording(of, channel, [&](std::size_t i, std::size_t, std::size_t c) {
    for (std::size_t k = 0; k < of.before[i][c].size(); ++k) {
      const double change = of.before[i][c][k] - of.after[i][c][k];
      if (!std::isnan(change)) out += change * change;
    }
  });
  return out;
}

bool is_of_the_motion(const Misses& of, Channel channel) {
  if (channel != Channel::displacement && channel != Channel::force) return false;
  const auto other = channel == Channel::force ? Channel::displacement : Channel::force;
  double product = 0, squares = 0;
  for_each_recording(of, channel, [&](std::size_t i, std::size_t r, std::size_t c) {
    const auto o = index_of(of.bench[r], other);
    if (!o) return;
    const auto over_range = [&](std::size_t ch) {
      return of.noise[r][ch].std() / of.bench[r].channels[ch].range;
    };
    for (std::size_t k = 0; k < of.before[i][c].size(); ++k) {
      const double change = (of.before[i][c][k] - of.after[i][c][k]) * over_range(c);
      const double left = of.after[i][*o][k] * over_range(*o);
      if (std::isnan(change) || std::isnan(left)) continue;
      product += change * left;
      squares += change * change;
    }
  });
  return std::abs(product) > least_slope_of_motion * squares;
}

}  // namespace ferrobench::model::inference

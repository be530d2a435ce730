#include "recordings/analysis/signals.h"

#include <algorithm>
#include <cmath>

#include "recordings/analysis/device_channels.h"
#include "recordings/analysis/loops.h"
#include "recordings/analysis/noise_colour.h"
#include "recordings/analysis/statistics.h"

namespace ferrobench::recordings {
namespace {

double lsb_of(const Recording& recording, Channel channel) {
  if (!recording.raw) return 0;
  const auto found = std::ranges::find(recording.raw->columns, channel, &RawColumn::channel);
  return found == recording.raw->columns.end() ? 0 : std::abs(found->gain);
}

// Without a figure of the noise from elsewhere it is estimated. `lsb`: of the converter, 0 if not known.
void judge(Signal& signal, const std::vector<double>& time, std::optional<double> known, double lsb) {
  signal.lsb = lsb;
  signal.noise = known ? *known : estimate_noise(signal.values);
  const auto range = extremes(signal.values);
  signal.exact = range && !(signal.noise > 1e-6 * range->span());
  if (signal.exact) {
    signal.statistics = Noise(0, {}, lsb);
    return;
  }
  constexpr std::size_t enough = 8, most = 500;  // windows
  QuietWindows quiet(time, signal.values, signal.noise, most);
  keep_quiet(std::span(&quiet, 1));
  if (quiet.size() < enough) {
    signal.statistics =
        Noise(known ? std::hypot(signal.noise, lsb / std::sqrt(12.0)) : signal.noise, {}, lsb);
    return;
  }
  const auto colour = colour_of(std::span(&quiet, 1));
  signal.statistics =
      Noise(signal.noise * quiet.level() * std::sqrt(6 / colour.second_differences()), colour, lsb);
}

// `unit`: of the recording's figures in the signal's.
void judge(Signal& signal, const Recording& recording, Channel channel, double unit) {
  const auto index = static_cast<std::size_t>(channel);
  const auto& known = recording.noise.at(index);
  judge(signal, recording.time, known ? std::optional(*known / unit) : std::nullopt,
        lsb_of(recording, channel) / unit);
  signal.gain_uncertainty = stated_by_channel(recording.header.device, "gain_uncertainty").at(index);
}

}  // namespace

Reading Signal::reading(std::size_t at) const {
  if (!fits) return {values[at], {{at, 1}}};
  const auto reach = fits->reach[at];
  return parabola_reading(measured, at, reach.before, reach.after);
}

Reading Signal::extreme(std::size_t at) const {
  return fits ? extreme_reading(measured, *fits, statistics, at) : reading(at);
}

Estimate Signal::estimate(const Reading& reading) const {
  return {reading.value, std::sqrt(statistics.variance(reading.weights)),
          gain_uncertainty * std::abs(reading.value)};
}

Signal signal(const Recording& recording, Channel channel) {
  Signal out{.values = recording.at(channel)};
  judge(out, recording, channel, 1);
  return out;
}

Signal polarization(const Recording& recording) {
  const auto& specimen = recording.header.specimen;
  const double total_area = specimen.area * static_cast<double>(specimen.layer_count);
  const auto& charge = recording.at(Channel::charge);
  auto values = std::make_shared<std::vector<double>>(charge.size());
  std::ranges::transform(charge, values->begin(), [&](double q) { return q / total_area; });
  Signal out{.values = *values, .own = values};
  judge(out, recording, Channel::charge, total_area);
  return out;
}

const std::vector<double>& field_of(const Recording& recording) {
  return recording.at(recording.has(Channel::field) ? Channel::field : Channel::command);
}

Signal smoothed(Signal signal, const std::vector<Turn>& turns) {
  if (signal.exact || signal.values.size() < 2) return signal;
  signal.measured = signal.values;
  signal.fits = std::make_shared<Smoothed>(smooth(signal.measured, signal.statistics, turns));
  signal.values = signal.fits->values;
  return signal;
}

Reading edge_reading(const Recording& recording, const Signal& signal, std::size_t first, std::size_t count,
                     bool at_end) {
  // Creep is fastest at the start, where a line through many samples would cut the corner: no more than it
  // takes to bring the noise (a line's end has twice that of a mean) to 1 % of how far the stretch goes.
  const std::size_t most = std::max<std::size_t>(5, count / 100);
  const double change = signal.values[first + count - 1] - signal.values[first];
  const double allowed = 0.01 * std::max(std::abs(change) - 3 * signal.noise, 0.0);
  const double wanted = std::ceil(std::pow(2 * signal.noise / std::max(allowed, 1e-300), 2));
  return line_reading(recording.time, signal.values, signal.statistics, first, count, at_end,
                      signal.exact                         ? 1
                      : wanted < static_cast<double>(most) ? static_cast<std::size_t>(wanted)
                                                           : most);
}

}  // namespace ferrobench::recordings

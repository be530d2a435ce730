#include "recordings/analysis/signals.h"

#include <cmath>

#include "recordings/analysis/loops.h"
#include "recordings/analysis/parabolas.h"
#include "recordings/analysis/statistics.h"

namespace ferrobench::recordings {
namespace {

void judge(Signal& signal, std::optional<double> noise) {
  signal.noise = noise ? *noise : estimate_noise(signal.values);
  const auto range = extremes(signal.values);
  signal.exact = range && !(signal.noise > 1e-6 * range->span());
}

// The parabola of least squares through y[first..last] at sample `at`; samples count as equally spaced.
double parabola_at(std::span<const double> y, std::size_t first, std::size_t last, std::size_t at) {
  std::array<double, 5> s{};
  std::array<double, 3> m{};
  for (std::size_t i = first; i <= last; ++i) {
    if (std::isnan(y[i])) continue;
    const double x = static_cast<double>(i) - static_cast<double>(at);
    const double x2 = x * x;
    s[0] += 1, s[1] += x, s[2] += x2, s[3] += x2 * x, s[4] += x2 * x2;
    m[0] += y[i], m[1] += x * y[i], m[2] += x2 * y[i];
  }
  const double determinant = s[0] * (s[2] * s[4] - s[3] * s[3]) - s[1] * (s[1] * s[4] - s[2] * s[3]) +
                             s[2] * (s[1] * s[3] - s[2] * s[2]);
  if (s[0] < 3 || !(determinant > 1e-9 * s[0] * s[2] * s[4])) return y[at];
  return (m[0] * (s[2] * s[4] - s[3] * s[3]) - s[1] * (m[1] * s[4] - s[3] * m[2]) +
          s[2] * (m[1] * s[3] - s[2] * m[2])) /
         determinant;
}

void smooth_leg(std::span<const double> y, std::size_t first, std::size_t last, std::span<double> out) {
  const std::size_t half = std::min<std::size_t>((last - first) / 40, 50);
  if (half < 2) {  // the corner before stays as the leg before left it
    std::ranges::copy(y.subspan(first + 1, last - first), out.subspan(first + 1).begin());
    return;
  }
  // Near the ends of the leg, and around gaps, fewer samples count.
  const auto by_itself = [&](std::size_t i) {
    out[i] = parabola_at(y, i > first + half ? i - half : first, std::min(last, i + half), i);
  };
  const std::size_t from = first + half, to = last - half + 1;
  for (std::size_t i = first; i < from; ++i) by_itself(i);
  parabolas(y.data() + from, half, out.subspan(from, to - from));
  for (std::size_t i = from; i < to; ++i)
    if (std::isnan(out[i])) by_itself(i);
  for (std::size_t i = to; i <= last; ++i) by_itself(i);
}

}  // namespace

Signal signal(const Recording& recording, Channel channel) {
  Signal out{.values = recording.at(channel)};
  judge(out, recording.noise.at(static_cast<std::size_t>(channel)));
  return out;
}

Signal polarization(const Recording& recording) {
  const auto& specimen = recording.header.specimen;
  const double total_area = specimen.area * static_cast<double>(specimen.layer_count);
  const auto& charge = recording.at(Channel::charge);
  auto values = std::make_shared<std::vector<double>>(charge.size());
  std::ranges::transform(charge, values->begin(), [&](double q) { return q / total_area; });
  Signal out{.values = *values, .own = values};
  auto noise = recording.noise.at(static_cast<std::size_t>(Channel::charge));
  if (noise) noise = *noise / total_area;
  judge(out, noise);
  return out;
}

const std::vector<double>& field_of(const Recording& recording) {
  return recording.at(recording.has(Channel::field) ? Channel::field : Channel::command);
}

Signal smoothed(Signal signal, const std::vector<Turn>& turns) {
  if (signal.exact || signal.values.size() < 2) return signal;
  auto out = std::make_shared<std::vector<double>>(signal.values.size());
  out->front() = signal.values.front();
  std::vector<std::size_t> corners{0, out->size() - 1};
  for (const auto& turn : turns) {
    corners.push_back(turn.arrive);
    corners.push_back(turn.leave);
  }
  std::ranges::sort(corners);
  for (std::size_t i = 1; i < corners.size(); ++i)
    smooth_leg(signal.values, corners[i - 1], corners[i], *out);
  signal.values = *out;
  signal.own = std::move(out);
  return signal;
}

double edge_value(const Recording& recording, const Signal& signal, std::size_t first, std::size_t count,
                  bool at_end) {
  const std::size_t at = at_end ? first + count - 1 : first;
  if (signal.exact) return signal.values[at];
  const auto line_through = [&](std::size_t samples) {
    const std::size_t part = std::clamp<std::size_t>(samples, 1, count);
    const std::size_t from = at_end ? first + count - part : first;
    if (part < 3) return signal.values[at];
    const double value =
        fit_line(std::span(recording.time).subspan(from, part), signal.values.subspan(from, part))
            .at(recording.time[at]);
    return std::isfinite(value) ? value : signal.values[at];
  };
  // Creep is fastest at the start, where a line through many samples would cut the corner: no more than it
  // takes to bring the noise (a line's end has twice that of a mean) to 1 % of how far the stretch goes.
  const std::size_t most = std::max<std::size_t>(5, count / 100);
  const double change = signal.values[first + count - 1] - signal.values[first];
  const double allowed = 0.01 * std::max(std::abs(change) - 3 * signal.noise, 0.0);
  const double wanted = std::ceil(std::pow(2 * signal.noise / std::max(allowed, 1e-300), 2));
  return line_through(wanted < static_cast<double>(most) ? static_cast<std::size_t>(wanted) : most);
}

}  // namespace ferrobench::recordings

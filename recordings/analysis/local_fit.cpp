#include "recordings/analysis/local_fit.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numbers>
#include <utility>

#include "recordings/analysis/parabolas.h"

namespace ferrobench::recordings {
namespace {

// Standard deviations by which hardly one of so many values differs by noise alone, three at least.
double agrees_among(std::size_t values) {
  return std::max(3.0, std::sqrt(2 * std::log(static_cast<double>(values))));
}
constexpr std::size_t widest_half = 100;

// The weight of a sample x rows away in the value that the parabola of least squares has at 0.
struct Kernel {
  std::array<double, 3> c{};
  bool solvable = false;
  double at(double x) const { return c[0] + x * (c[1] + x * c[2]); }
};

// Rows before and after a sample.
struct Around {
  int before = 0, after = 0;
};

// Over these rows; `known` says which of them have a sample.
Kernel kernel(Around window, const auto& known) {
  if (window.before == 0 && window.after == 0) return {{1, 0, 0}, true};
  std::array<double, 5> s{};
  for (int i = -window.before; i <= window.after; ++i) {
    if (!known(i)) continue;
    const double x = i, x2 = x * x;
    s[0] += 1, s[1] += x, s[2] += x2, s[3] += x2 * x, s[4] += x2 * x2;
  }
  const double a = s[2] * s[4] - s[3] * s[3], b = s[2] * s[3] - s[1] * s[4], c = s[1] * s[3] - s[2] * s[2];
  const double determinant = s[0] * a + s[1] * b + s[2] * c;
  if (s[0] < 3 || !(determinant > 1e-9 * s[0] * s[2] * s[4])) return {};
  return {{a / determinant, b / determinant, c / determinant}, true};
}

Reach reach_within(std::size_t first, std::size_t last, std::size_t at, std::size_t half) {
  return {static_cast<std::uint8_t>(std::min(at - first, half)),
          static_cast<std::uint8_t>(std::min(last - at, half))};
}

// visit(sample, weight) for each sample that makes the parabola's value at sample `at`: itself alone where
// the others are too few.
void weigh(std::span<const double> y, std::size_t at, Around window, const auto& visit) {
  const double* centre = y.data() + at;
  const auto known = [centre](int i) { return !std::isnan(centre[i]); };
  const auto k = kernel(window, known);
  if (!k.solvable) return visit(at, 1.0);
  for (int i = -window.before; i <= window.after; ++i)
    if (known(i)) visit(static_cast<std::size_t>(static_cast<std::ptrdiff_t>(at) + i), k.at(i));
}

double parabola_at(std::span<const double> y, std::size_t at, Reach reach) {
  double sum = 0;
  weigh(y, at, {reach.before, reach.after}, [&](std::size_t i, double weight) { sum += weight * y[i]; });
  return sum;
}

// Standard deviations of the difference between the values of two windows, by how many samples the wider one
// has before its sample (or after it, which by symmetry is the same).
std::vector<double> difference_deviations(const Noise& noise, std::size_t narrow, std::size_t wide) {
  const auto all = [](int) { return true; };
  std::vector<double> out;
  for (std::size_t before = 0; before <= wide; ++before) {
    const auto clipped = [&](std::size_t half) { return reach_within(0, before + wide, before, half); };
    const auto inner = clipped(narrow), outer = clipped(wide);
    const auto a = kernel({outer.before, outer.after}, all), b = kernel({inner.before, inner.after}, all);
    std::vector<Weight> weights;
    for (int i = -outer.before; i <= outer.after; ++i) {
      const bool within = -i <= inner.before && i <= inner.after;
      weights.push_back({static_cast<std::size_t>(i + outer.before), a.at(i) - (within ? b.at(i) : 0)});
    }
    out.push_back(std::sqrt(noise.variance(std::move(weights))));
  }
  return out;
}

class Smoother {
 public:
  Smoother(std::span<const double> y, const Noise& noise)
      : y_(y), noise_(noise), agrees_(agrees_among(y.size())) {
    out_.values.assign(y.begin(), y.end());
    out_.reach.resize(y.size());
  }

  void leg(std::size_t first, std::size_t last) {
    const std::size_t widest = std::min((last - first) / 20, widest_half);
    if (widest < 4) return;  // the corner before stays as the leg before left it
    std::vector<std::size_t> halves{widest};
    while (halves.back() >= 4) halves.push_back(halves.back() / 2);
    halves.push_back(0);
    std::ranges::reverse(halves);
    const std::size_t count = last - first + 1;
    std::vector<double> narrow(y_.begin() + static_cast<std::ptrdiff_t>(first),
                               y_.begin() + static_cast<std::ptrdiff_t>(last + 1)),
        wide(count);
    std::vector<char> open(count, 1);
    for (std::size_t i = 0; i < count; ++i) take(first, last, i, narrow[i], 0);
    for (std::size_t k = 1; k < halves.size(); ++k) {
      over(first, last, halves[k], wide);
      const auto& deviations = deviations_of(halves[k - 1], halves[k]);
      for (std::size_t i = 0; i < count; ++i) {
        if (open[i] == 0) continue;
        const double allowed = deviations[std::min({i, count - 1 - i, halves[k]})];
        // Where both are the same samples, rounding is all that differs.
        open[i] = std::abs(wide[i] - narrow[i]) <= agrees_ * allowed + 1e-12 * std::abs(narrow[i]) ? 1 : 0;
        if (open[i] != 0) take(first, last, i, narrow[i], halves[k - 1]);
      }
      std::swap(narrow, wide);
    }
  }

  Smoothed done() && { return std::move(out_); }

 private:
  void take(std::size_t first, std::size_t last, std::size_t i, double value, std::size_t half) {
    out_.values[first + i] = value;
    out_.reach[first + i] = reach_within(first, last, first + i, half);
  }

  // Near the ends of the leg, and around gaps, fewer samples count.
  void over(std::size_t first, std::size_t last, std::size_t half, std::vector<double>& out) const {
    const auto by_itself = [&](std::size_t i) {
      out[i - first] = parabola_at(y_, i, reach_within(first, last, i, half));
    };
    const std::size_t from = first + half, to = last - half + 1;
    for (std::size_t i = first; i < from; ++i) by_itself(i);
    parabolas(y_.data() + from, half, std::span(out).subspan(half, to - from));
    for (std::size_t i = from; i < to; ++i)
      if (std::isnan(out[i - first])) by_itself(i);
    for (std::size_t i = to; i <= last; ++i) by_itself(i);
  }

  const std::vector<double>& deviations_of(std::size_t narrow, std::size_t wide) {
    auto& known = deviations_[{narrow, wide}];
    if (known.empty()) known = difference_deviations(noise_, narrow, wide);
    return known;
  }

  std::span<const double> y_;
  const Noise& noise_;
  double agrees_;
  std::map<std::pair<std::size_t, std::size_t>, std::vector<double>> deviations_;
  Smoothed out_;
};

// The line of least squares through y[from .. from + count), at sample `at`. Fewer than two samples: that
// sample.
Reading line_at(std::span<const double> time, std::span<const double> y, std::size_t from, std::size_t count,
                std::size_t at) {
  double known = 0, mean = 0, squares = 0;
  const auto each = [&](const auto& visit) {
    for (std::size_t i = from; i < from + count; ++i)
      if (!std::isnan(y[i])) visit(i);
  };
  each([&](std::size_t i) { ++known, mean += time[i]; });
  mean /= known;
  each([&](std::size_t i) { squares += (time[i] - mean) * (time[i] - mean); });
  if (!(known >= 2) || !(squares > 0)) return {y[at], {{at, 1}}};
  Reading out;
  each([&](std::size_t i) {
    const double weight = 1 / known + (time[at] - mean) * (time[i] - mean) / squares;
    out.value += weight * y[i];
    out.weights.push_back({i, weight});
  });
  return out;
}

}  // namespace

Smoothed smooth(std::span<const double> y, const Noise& noise, const std::vector<Turn>& turns) {
  Smoother smoother(y, noise);
  std::vector<std::size_t> corners{0, y.size() - 1};
  for (const auto& turn : turns) {
    corners.push_back(turn.arrive);
    corners.push_back(turn.leave);
  }
  std::ranges::sort(corners);
  for (std::size_t i = 1; i < corners.size(); ++i) smoother.leg(corners[i - 1], corners[i]);
  auto out = std::move(smoother).done();
  out.corners = std::move(corners);
  return out;
}

Reading parabola_reading(std::span<const double> y, std::size_t at, std::size_t before, std::size_t after) {
  Reading out;
  weigh(y, at, {static_cast<int>(before), static_cast<int>(after)}, [&](std::size_t i, double weight) {
    out.value += weight * y[i];
    out.weights.push_back({i, weight});
  });
  return out;
}

Reading extreme_reading(std::span<const double> y, const Smoothed& smoothed, const Noise& noise,
                        std::size_t at) {
  constexpr std::size_t most = 2000;
  constexpr double alike = 2;
  const auto reading = [&](std::size_t i) {
    return parabola_reading(y, i, smoothed.reach[i].before, smoothed.reach[i].after);
  };
  const auto deviation = [&](const Reading& r) { return std::sqrt(noise.variance(r.weights)); };
  auto chosen = reading(at);
  const auto after = std::ranges::lower_bound(smoothed.corners, at);
  const auto near_corner = [&](std::size_t corner) {
    const auto reach = smoothed.reach[at];
    if (corner + reach.before < at || corner > at + reach.after) return false;
    const auto difference = chosen - reading(corner);
    return std::abs(difference.value) <= alike * deviation(difference);
  };
  if (after != smoothed.corners.end() && near_corner(*after)) {
    at = *after;
  } else if (after != smoothed.corners.begin() && near_corner(*std::prev(after))) {
    at = *std::prev(after);
  }
  chosen = reading(at);
  const double agrees = agrees_among(y.size()), differs = agrees * std::numbers::sqrt2 * deviation(chosen);
  const auto is_near = [&](std::size_t i) {
    return std::abs(smoothed.values[i] - smoothed.values[at]) <= differs;
  };
  // The leg by which it is read.
  const auto& corners = smoothed.corners;
  auto end = std::ranges::lower_bound(corners, at);
  if (end != corners.end() && *end == at && (end == corners.begin() || smoothed.reach[at].before == 0)) ++end;
  const std::size_t begins = end == corners.begin() ? 0 : *std::prev(end),
                    ends = end == corners.end() ? y.size() - 1 : *end;
  std::size_t first = at, last = at;
  while (first > begins && at - first < most && is_near(first - 1)) --first;
  while (last < ends && last - at < most && is_near(last + 1)) ++last;
  auto narrow = chosen;
  const std::size_t widest = std::max(at - first, last - at);
  std::size_t half = std::max(smoothed.reach[at].before, smoothed.reach[at].after);
  while (half < widest) {
    half = std::min(widest, std::max<std::size_t>(2, 2 * half));
    auto wide = parabola_reading(y, at, std::min(at - first, half), std::min(last - at, half));
    const auto difference = wide - narrow;
    if (!(std::abs(difference.value) <= agrees * deviation(difference))) break;
    chosen = std::exchange(narrow, std::move(wide));
  }
  return chosen;
}

Reading line_reading(std::span<const double> time, std::span<const double> y, const Noise& noise,
                     std::size_t first, std::size_t count, bool at_end, std::size_t most) {
  const std::size_t at = at_end ? first + count - 1 : first;
  most = std::clamp<std::size_t>(most, 1, count);
  if (most < 3) return {y[at], {{at, 1}}};
  const auto through = [&](std::size_t samples) {
    return line_at(time, y, at_end ? first + count - samples : first, samples, at);
  };
  constexpr std::size_t fewest = 5;
  constexpr double agrees = 3, agrees_well = 1;  // standard deviations
  std::size_t samples = std::min(most, fewest);
  auto chosen = through(samples), narrow = chosen;
  while (samples < most) {
    samples = std::min(most, 2 * samples);
    auto wide = through(samples);
    const auto difference = wide - narrow;
    const double allowed = std::sqrt(noise.variance(difference.weights));
    if (!(std::abs(difference.value) <= agrees * allowed)) break;
    chosen = samples == most && std::abs(difference.value) <= agrees_well * allowed ? wide : narrow;
    narrow = std::move(wide);
  }
  return chosen;
}

}  // namespace ferrobench::recordings

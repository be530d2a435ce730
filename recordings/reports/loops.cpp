#include "recordings/reports/loops.h"

#include <algorithm>
#include <cmath>

namespace ferrobench::recordings {

double loop_integral(std::span<const double> x, std::span<const double> y) {
  double sum = 0;
  std::size_t first = x.size(), before = 0;
  const auto add = [&](std::size_t a, std::size_t b) { sum += 0.5 * (x[a] + x[b]) * (y[b] - y[a]); };
  for (std::size_t i = 0; i < x.size(); ++i) {
    if (std::isnan(x[i]) || std::isnan(y[i])) continue;
    if (first == x.size()) {
      first = i;
    } else {
      add(before, i);
    }
    before = i;
  }
  if (first < x.size()) add(before, first);
  return sum;
}

namespace {

// A branch as a function of x: where x does not get on, the last y counts.
struct Branch {
  std::vector<double> x, y;
  void add(double px, double py) {
    if (std::isnan(px) || std::isnan(py)) return;
    if (!x.empty() && px <= x.back()) {
      y.back() = py;
    } else {
      x.push_back(px);
      y.push_back(py);
    }
  }
  double at(double px) const {
    const auto above = std::ranges::upper_bound(x, px);
    if (above == x.begin()) return y.front();
    if (above == x.end()) return y.back();
    const auto i = static_cast<std::size_t>(above - x.begin());
    return y[i - 1] + (y[i] - y[i - 1]) * (px - x[i - 1]) / (x[i] - x[i - 1]);
  }
};

}  // namespace

double enclosed_area(std::span<const double> x, std::span<const double> y) {
  std::size_t far = 0;
  double travelled = 0, before = x.empty() ? NAN : x[0];
  for (std::size_t i = 0; i < x.size(); ++i) {
    if (std::isnan(x[i])) continue;
    if (std::isnan(before)) before = x[i];
    travelled += std::abs(x[i] - before);
    before = x[i];
    if (!(std::abs(x[i] - x[0]) <= std::abs(x[far] - x[0]))) far = i;
  }
  const double span = x.empty() ? 0 : std::abs(x[far] - x[0]);
  if (!(travelled <= 2.1 * span)) return std::abs(loop_integral(x, y));
  const double sign = x[far] > x[0] ? 1 : -1;
  Branch out, back;
  for (std::size_t i = 0; i <= far; ++i) out.add(sign * x[i], y[i]);
  for (std::size_t i = x.size(); i-- > far;) back.add(sign * x[i], y[i]);
  if (out.x.size() < 2 || back.x.size() < 2) return 0;
  constexpr int steps = 4000;
  const double low = std::max(out.x.front(), back.x.front()), high = std::min(out.x.back(), back.x.back());
  double area = 0;
  for (int i = 0; i < steps; ++i) {
    const double at = low + (high - low) * (i + 0.5) / steps;
    area += std::abs(out.at(at) - back.at(at));
  }
  return area * (high - low) / steps;
}

std::optional<Extremes> extremes(std::span<const double> values) {
  std::optional<Extremes> out;
  for (const double v : values) {
    if (std::isnan(v)) continue;
    if (!out) out = Extremes{v, v};
    out->low = std::min(out->low, v);
    out->high = std::max(out->high, v);
  }
  return out;
}

std::vector<double> crossings(std::span<const double> x, std::span<const double> y, double level) {
  std::vector<double> out;
  std::size_t before = y.size();
  for (std::size_t i = 0; i < y.size(); ++i) {
    if (std::isnan(x[i]) || std::isnan(y[i])) continue;
    if (before < y.size()) {
      const double a = y[before] - level, b = y[i] - level;
      if ((a < 0) != (b < 0) && a != b) out.push_back(x[before] + (x[i] - x[before]) * a / (a - b));
    }
    before = i;
  }
  return out;
}

}  // namespace ferrobench::recordings

#include "recordings/reports/loops.h"

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

#include "recordings/statistics.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace ferrobench::recordings {

Line fit_line(std::span<const double> x, std::span<const double> y) {
  double sum_x = 0, sum_y = 0, count = 0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    if (std::isnan(y[i])) continue;
    sum_x += x[i];
    sum_y += y[i];
    ++count;
  }
  Line line;
  if (count == 0) return line;
  line.x0 = sum_x / count;
  line.y0 = sum_y / count;
  double xx = 0, xy = 0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    if (std::isnan(y[i])) continue;
    xx += (x[i] - line.x0) * (x[i] - line.x0);
    xy += (x[i] - line.x0) * (y[i] - line.y0);
  }
  line.slope = xx > 0 ? xy / xx : 0;
  return line;
}

double median(std::vector<double> values) {
  if (values.empty()) return std::numeric_limits<double>::quiet_NaN();
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  if (values.size() % 2 == 1) return *middle;
  return 0.5 * (*middle + *std::max_element(values.begin(), middle));
}

double estimate_noise(std::span<const double> y) {
  std::vector<double> bends;
  bends.reserve(y.size());
  for (std::size_t i = 1; i + 1 < y.size(); ++i) {
    const double bend = std::abs(y[i - 1] - 2 * y[i] + y[i + 1]);
    if (!std::isnan(bend)) bends.push_back(bend);
  }
  return bends.empty() ? 0 : median(std::move(bends)) / (0.67449 * std::sqrt(6.0));
}

double mean(std::span<const double> y) {
  double sum = 0, count = 0;
  for (const double value : y) {
    if (std::isnan(value)) continue;
    sum += value;
    ++count;
  }
  return sum / count;
}

}  // namespace ferrobench::recordings

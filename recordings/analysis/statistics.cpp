#include "recordings/analysis/statistics.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numeric>

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

// The median of the bends without a list of them all: first how many share their leading 16 bits, then those
// in the middle. The bits of numbers that are not negative order as they do, with NaN past infinity.
double estimate_noise(std::span<const double> y) {
  constexpr std::size_t infinite = 0x7ff0;
  const auto bend = [&y](std::size_t i) { return std::abs(y[i - 1] - 2 * y[i] + y[i + 1]); };
  const auto leading = [](double v) { return std::bit_cast<std::uint64_t>(v) >> 48; };
  std::vector<std::size_t> alike(1u << 16);
  for (std::size_t i = 1; i + 1 < y.size(); ++i) ++alike[leading(bend(i))];
  const auto known = std::accumulate(alike.begin(), alike.begin() + infinite + 1, std::size_t{0});
  if (known == 0) return 0;

  std::size_t below = 0, first = 0;
  while (below + alike[first] <= (known - 1) / 2) below += alike[first++];
  std::size_t last = first, among = alike[first];
  while (below + among <= known / 2) among += alike[++last];
  std::vector<double> middle(among + 1);  // and one to write past them
  std::size_t found = 0;
  for (std::size_t i = 1; i + 1 < y.size(); ++i) {
    const double value = middle[found] = bend(i);
    found += leading(value) - first <= last - first;
  }
  middle.pop_back();
  const auto upper = middle.begin() + static_cast<std::ptrdiff_t>(known / 2 - below);
  std::nth_element(middle.begin(), upper, middle.end());
  const double median = known % 2 == 1 ? *upper : 0.5 * (*upper + *std::max_element(middle.begin(), upper));
  return median / (0.67449 * std::sqrt(6.0));
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

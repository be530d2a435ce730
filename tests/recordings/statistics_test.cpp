// Estimates and loops against their definitions, taken literally.
#include "recordings/analysis/statistics.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

#include "recordings/analysis/loops.h"
#include "recordings/analysis/parabolas.h"

namespace ferrobench::recordings {
namespace {

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

double noise_by_definition(const std::vector<double>& y) {
  std::vector<double> bends;
  for (std::size_t i = 1; i + 1 < y.size(); ++i) {
    const double bend = std::abs(y[i - 1] - 2 * y[i] + y[i + 1]);
    if (!std::isnan(bend)) bends.push_back(bend);
  }
  return bends.empty() ? 0 : median(bends) / (0.67449 * std::sqrt(6.0));
}

TEST(Noise, IsTheMedianOfTheBends) {
  std::mt19937 random(1);
  std::normal_distribution<double> normal(0, 1);
  for (std::size_t size = 0; size < 300; ++size) {
    std::vector<double> y(size);
    for (auto& v : y) v = 1e-6 * normal(random);
    EXPECT_EQ(estimate_noise(y), noise_by_definition(y));
    for (auto& v : y)
      v = std::round(4e6 * v) * 1e-9;  // as of a converter: few values, some of them exactly 0
    EXPECT_EQ(estimate_noise(y), noise_by_definition(y));
    for (std::size_t i = size % 7; i < size; i += 5) y[i] = nan;
    EXPECT_EQ(estimate_noise(y), noise_by_definition(y));
    for (std::size_t i = 0; i < size; ++i) y[i] = i % 4 == 0 ? std::ldexp(1.0, static_cast<int>(i)) : 0;
    EXPECT_EQ(estimate_noise(y), noise_by_definition(y));
  }
  EXPECT_EQ(estimate_noise(std::vector<double>(100, nan)), 0);
}

TEST(Parabolas, GoThroughACubicsMiddleAndDoNotDependOnWhereTheyAre) {
  std::mt19937 random(2);
  std::normal_distribution<double> normal(0, 1);
  for (const std::size_t half : {2, 3, 17, 50})
    for (const std::size_t count : {1, 7, 8, 31, 64, 1000}) {
      std::vector<double> cubic, noisy;
      for (std::size_t i = 0; i < count + 2 * half; ++i) {
        const double x = static_cast<double>(i) / 100;
        cubic.push_back(1 + x - 3 * x * x + x * x * x);
        noisy.push_back(normal(random));
      }
      std::vector<double> out(count);
      parabolas(cubic.data() + half, half, out);
      for (std::size_t i = 0; i < count; ++i)
        EXPECT_NEAR(out[i], cubic[half + i], 1e-12 * (1 + std::abs(cubic[half + i])));
      // One by one there is no room for vectors.
      parabolas(noisy.data() + half, half, out);
      for (std::size_t i = 0; i < count; ++i) {
        double alone = 0;
        parabolas(noisy.data() + half + i, half, {&alone, 1});
        EXPECT_EQ(out[i], alone);
      }
    }
}

TEST(EnclosedArea, LiesBetweenTheWayOutAndTheWayBack) {
  // Up along y = 0, with a step back on the way; down along y = x / 2.
  const std::vector<double> x{0, 1, 0.98, 2, 3, 2, 1, 0}, y{0, 0, 0, 0, 0, 1, 0.5, 0};
  EXPECT_NEAR(enclosed_area(x, y), 0.5 * 2 * 1 + 0.5 * 1 * 1, 1e-3);
  std::vector<double> gap = y;
  gap[1] = gap[5] = nan;
  EXPECT_NEAR(enclosed_area(x, gap), 0.5 * 1 * 0.5 + 0.5 * 2 * 0.5, 1e-3);
  // Ways that have no field in common enclose nothing.
  EXPECT_EQ(enclosed_area(std::vector<double>{0, 0.2, 0.4, 1, 0.8, 0.7, 0.65},
                          std::vector<double>{0, 0.1, 0.2, nan, nan, 0.3, 0.4}),
            0);
}

// A butterfly, y = |x| up to a lag: the same area wherever on it the loop begins and ends.
TEST(EnclosedArea, IsTheSameWhereverTheLoopBegins) {
  const std::vector<double> x{-1, -0.5, 0, 0.5, 1, 0.5, 0, -0.5}, y{1, 0.5, 0, 0.9, 1, 0.5, 0, 0.9};
  for (std::size_t begin = 0; begin < x.size(); ++begin) {
    std::vector<double> fields, values;
    for (std::size_t i = 0; i <= x.size(); ++i) {
      fields.push_back(x[(begin + i) % x.size()]);
      values.push_back(y[(begin + i) % x.size()]);
    }
    EXPECT_NEAR(enclosed_area(fields, values), 2 * 0.5 * 1 * 0.4, 1e-6) << begin;
  }
}

}  // namespace
}  // namespace ferrobench::recordings

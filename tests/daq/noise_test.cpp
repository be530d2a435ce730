#include "daq/virtual/noise.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

namespace ferrobench::daq {
namespace {

std::vector<double> draw(std::uint64_t seed, std::uint64_t stream, std::size_t count) {
  std::vector<double> out(count, 0.0);
  Noise(seed, stream).add(0, 1, out);
  return out;
}

double correlation(const std::vector<double>& a, const std::vector<double>& b, std::size_t lag) {
  double sum = 0;
  for (std::size_t i = lag; i < a.size(); ++i) sum += a[i] * b[i - lag];
  return sum / static_cast<double>(a.size() - lag);
}

constexpr std::size_t many = 1'000'000;
constexpr double five_sigma = 5e-3;  // of a mean of a million

TEST(Noise, IsTheSameHoweverItIsCutIntoBlocks) {
  const auto whole = draw(7, 2, 10'007);
  for (const std::size_t block : {1U, 2U, 3U, 5U, 64U, 4096U}) {
    std::vector<double> parts(whole.size(), 0.0);
    for (std::size_t i = 0; i < parts.size(); i += block)
      Noise(7, 2).add(i, 1, std::span(parts).subspan(i, std::min(block, parts.size() - i)));
    EXPECT_EQ(parts, whole) << "blocks of " << block;
  }
}

TEST(Noise, HasTheStandardDeviationAskedFor) {
  std::vector<double> values(many, 3.0);
  Noise(1, 1).add(0, 0.25, values);
  double sum = 0, squares = 0;
  for (const double v : values) {
    sum += v - 3;
    squares += (v - 3) * (v - 3);
  }
  EXPECT_NEAR(sum / many, 0, 0.25 * five_sigma);
  // Chi-square of a million degrees of freedom is within 5 sqrt(2 / n) of 1.
  EXPECT_NEAR(squares / many / 0.0625, 1, 5 * std::sqrt(2.0 / many));
}

TEST(Noise, IsNormal) {
  auto values = draw(5, 3, many);
  std::sort(values.begin(), values.end());
  double distance = 0;  // Kolmogorov and Smirnov
  for (std::size_t i = 0; i < many; ++i)
    distance = std::max(distance, std::abs(0.5 * std::erfc(-values[i] / std::sqrt(2.0)) -
                                           (static_cast<double>(i) + 0.5) / many));
  EXPECT_LT(distance, 1.95 / std::sqrt(many));  // exceeded by chance once in a thousand
  EXPECT_GT(values.back(), 4.2);
  EXPECT_LT(values.front(), -4.2);
}

TEST(Noise, IsWhiteAndItsStreamsAreIndependent) {
  const auto a = draw(1, 1, many);
  for (const std::size_t lag : {1U, 2U, 3U, 4U, 100U})
    EXPECT_NEAR(correlation(a, a, lag), 0, five_sigma) << lag;
  for (const auto& b : {draw(1, 2, many), draw(2, 1, many)})
    for (const std::size_t lag : {0U, 1U, 2U}) EXPECT_NEAR(correlation(a, b, lag), 0, five_sigma) << lag;
}

}  // namespace
}  // namespace ferrobench::daq

// What is found of a noise of known level and colour, alone and beside a tone.
#include "recordings/analysis/noise_colour.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>
#include <utility>
#include <vector>

#include "recordings/analysis/statistics.h"

namespace ferrobench::recordings {
namespace {

struct Case {
  double slow_share = 0, rows = 0;  // of the noise, whose variance is 1
  double tone = 0;                  // amplitude
  double frequency = 0;             // periods in a row
  double ramp = 0;                  // slope of a triangle that turns every 500 rows
};

struct Channel {
  std::vector<double> time, value;
};

Channel channel(const Case& c, std::size_t count, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal(0, 1);
  const double a = c.rows > 0 ? std::exp(-1 / c.rows) : 0;
  double slow = normal(random);
  Channel out;
  for (std::size_t i = 0; i < count; ++i) {
    const double row = static_cast<double>(i), turned = std::abs(std::fmod(row, 1000) - 500);
    slow = a * slow + std::sqrt(1 - a * a) * normal(random);
    out.time.push_back(1e-3 * row);
    out.value.push_back(std::sqrt(1 - c.slow_share) * normal(random) + std::sqrt(c.slow_share) * slow +
                        c.tone * std::sin(2 * std::numbers::pi * c.frequency * row) + c.ramp * turned);
  }
  return out;
}

struct Found {
  NoiseColour colour;
  double level = 0;
  bool has_tone = false;
};

Found found_in(const Channel& c) {
  const double scatter = estimate_noise(c.value);
  QuietWindows quiet(c.time, c.value, scatter);
  keep_quiet(std::span(&quiet, 1));
  const auto colour = colour_of(std::span(&quiet, 1));
  return {colour, scatter * quiet.level() * std::sqrt(6 / colour.second_differences()), quiet.has_tone()};
}

// Windows in which a correlated noise happens to be small count as quiet, so that it comes out too small by a
// fifth.
TEST(NoiseColour, IsFoundAlone) {
  for (unsigned seed = 1; seed <= 20; ++seed) {
    const auto white = found_in(channel({}, 4000, seed));
    EXPECT_EQ(white.colour.rows, 0);
    EXPECT_FALSE(white.has_tone);
    EXPECT_NEAR(white.level, 1, 0.05);
    const auto slow = found_in(channel({.slow_share = 0.8, .rows = 6}, 10000, seed));
    EXPECT_NEAR(slow.colour.slow_share, 0.8, 0.2);
    EXPECT_NEAR(slow.level, 1, 0.25);
  }
}

// Mains hum that is sampled seldom may be many times what a quiet converter adds, at any frequency.
TEST(NoiseColour, IsThatWithoutATone) {
  for (unsigned seed = 1; seed <= 20; ++seed)
    for (const auto& [tone, ramp] : {std::pair{3.0, 0.0}, {30.0, 0.0}, {1000.0, 0.0}, {30.0, 3.0}}) {
      const double frequency = 0.06 + 0.021 * seed + 1e-4 * std::numbers::pi * seed;
      const auto found = found_in(channel({.tone = tone, .frequency = frequency, .ramp = ramp}, 4000, seed));
      SCOPED_TRACE(testing::Message() << "tone " << tone << " at " << frequency << ", ramp " << ramp);
      EXPECT_TRUE(found.has_tone);
      EXPECT_EQ(found.colour.rows, 0);
      EXPECT_NEAR(found.level, 1, 0.08);
    }
}

// The bends of a tone, and so the scatter, hang on how often it was sampled; what is quiet does not.
TEST(NoiseColour, IsFoundInEveryRecordingOfATone) {
  for (unsigned seed = 1; seed <= 20; ++seed) {
    std::vector<QuietWindows> quiet;
    std::vector<double> scatters;
    for (const double frequency : {0.07, 0.13, 0.24, 0.31, 0.42}) {
      const auto c = channel({.tone = 25, .frequency = frequency, .ramp = 0.5}, 3000, seed);
      scatters.push_back(estimate_noise(c.value));
      quiet.emplace_back(c.time, c.value, scatters.back());
    }
    keep_quiet(quiet);
    EXPECT_EQ(colour_of(quiet).rows, 0);
    for (std::size_t i = 0; i < quiet.size(); ++i) {
      EXPECT_TRUE(quiet[i].has_tone());
      EXPECT_NEAR(scatters[i] * quiet[i].level(), 1, 0.08);
    }
  }
}

TEST(NoiseColour, IsFoundBesideATone) {
  for (unsigned seed = 1; seed <= 20; ++seed) {
    const auto found =
        found_in(channel({.slow_share = 0.8, .rows = 6, .tone = 30, .frequency = 0.21}, 10000, seed));
    EXPECT_TRUE(found.has_tone);
    EXPECT_NEAR(found.colour.slow_share, 0.8, 0.2);
    EXPECT_NEAR(found.level, 1, 0.25);
  }
}

// Of noise with a long memory a polynomial takes much, too, but not so much as of a signal.
TEST(NoiseColour, OfALongMemoryIsNoSignal) {
  for (unsigned seed = 1; seed <= 100; ++seed) {
    const auto found = found_in(channel({.slow_share = 1, .rows = 25}, 3000, seed));
    EXPECT_FALSE(found.colour.is_signal) << seed;
    EXPECT_GT(found.colour.slow_share, 0.8) << seed;
  }
}

// A loop that switches every 80 rows: 96 of them hold a step wherever they lie.
TEST(NoiseColour, OfASignalThatBendsIsNone) {
  for (unsigned seed = 1; seed <= 20; ++seed) {
    auto c = channel({}, 4000, seed);
    for (std::size_t i = 0; i < c.value.size(); ++i)
      c.value[i] += 10 * std::tanh(5 * std::sin(2 * std::numbers::pi * static_cast<double>(i) / 160));
    const auto found = found_in(c);
    EXPECT_TRUE(found.colour.is_signal) << seed;
    EXPECT_EQ(found.colour.rows, 0) << seed;
    EXPECT_NEAR(found.level, 1, 0.1) << seed;
  }
}

// A hold whose samples follow each other ever more slowly says nothing of a memory in rows.
TEST(NoiseColour, IsThatOfEvenlySpacedSamples) {
  auto c = channel({}, 4000, 1);
  const double scatter = estimate_noise(c.value);
  EXPECT_EQ(QuietWindows(c.time, c.value, scatter).size(), 41u);
  for (std::size_t i = 0; i < c.time.size(); ++i)
    c.time[i] = std::floor(static_cast<double>(i) / 48) + std::pow(static_cast<double>(i % 48) / 48, 2.5);
  EXPECT_EQ(QuietWindows(c.time, c.value, scatter).size(), 0u);
}

}  // namespace
}  // namespace ferrobench::recordings

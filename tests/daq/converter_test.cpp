#include "daq/virtual/converter.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace ferrobench::daq {
namespace {

using recordings::Channel;

std::int16_t one(const Sensor& sensor, double value, bool* clipped = nullptr) {
  std::int16_t count = 0;
  const bool was = Converter(Channel::force, sensor, 1).convert(0, std::span(&value, 1), &count, 1);
  if (clipped != nullptr) *clipped = was;
  return count;
}

TEST(Converter, ScalesBackToWithinHalfACount) {
  const Sensor sensor{.range = 750};
  const Converter converter(Channel::force, sensor, 1);
  const auto column = converter.column();
  for (double value = -749; value < 749; value += 0.7) {
    double copy = value;
    std::int16_t count = 0;
    EXPECT_FALSE(converter.convert(0, std::span(&copy, 1), &count, 1));
    EXPECT_NEAR(column.offset + column.gain * count, value, 0.5000001 * column.gain);
  }
}

TEST(Converter, ShowsTheSensorsGainAndOffset) {
  EXPECT_EQ(one({.range = 32768, .gain = 1.5, .offset = -7}, 1000), 1493);
}

TEST(Converter, ClipsAtTheEndsOfTheRangeAndSaysSo) {
  bool clipped = false;
  EXPECT_EQ(one({.range = 1}, 1.0 - 1.0 / 32768, &clipped), 32767);
  EXPECT_FALSE(clipped);
  EXPECT_EQ(one({.range = 1}, 1.01, &clipped), 32767);
  EXPECT_TRUE(clipped);
  EXPECT_EQ(one({.range = 1}, -1e300, &clipped), -32768);
  EXPECT_TRUE(clipped);
  EXPECT_EQ(one({.range = 1}, std::numeric_limits<double>::quiet_NaN(), &clipped), -32768);
  EXPECT_TRUE(clipped);
}

TEST(Converter, WritesItsOwnColumnOnly) {
  std::vector<double> values{1, 2, 3};
  std::vector<std::int16_t> counts(6, -1);
  Converter(Channel::charge, {.range = 32768}, 1).convert(0, values, counts.data() + 1, 2);
  EXPECT_EQ(counts, (std::vector<std::int16_t>{-1, 1, -1, 2, -1, 3}));
}

}  // namespace
}  // namespace ferrobench::daq

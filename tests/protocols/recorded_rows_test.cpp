#include "protocols/recorded_rows.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "tests/protocols/programs.h"

namespace ferrobench::protocols {
namespace {

std::vector<std::uint64_t> recorded(RecordedRows rows, std::uint64_t samples) {
  std::vector<std::uint64_t> out;
  for (std::uint64_t i = 1; i <= samples; ++i)
    if (rows.next() || i == samples) out.push_back(i);
  return out;
}

TEST(RecordedRows, AreAllWhereNothingIsAskedFor) {
  EXPECT_TRUE(RecordedRows().all());
  EXPECT_TRUE(RecordedRows({}, 1000).all());
  EXPECT_TRUE(RecordedRows({.rate = 1000}, 1000).all());
  EXPECT_TRUE(RecordedRows({.rate = 2000}, 1000).all());
  EXPECT_EQ(recorded(RecordedRows({}, 1000), 4), (std::vector<std::uint64_t>{1, 2, 3, 4}));
}

TEST(RecordedRows, AreEvenlySpacedAndNeverFewerThanAskedFor) {
  EXPECT_EQ(recorded(RecordedRows({.rate = 250}, 1000), 10), (std::vector<std::uint64_t>{4, 8, 10}));
  EXPECT_EQ(RecordedRows({.rate = 300}, 1000).stride(), 3U);
  // 1000 / 0.1 is no whole number in floating point at either side.
  EXPECT_EQ(RecordedRows({.rate = 0.1 * 3}, 0.9).stride(), 3U);
}

TEST(RecordedRows, OfAHoldGetRarerByTheDecade) {
  constexpr double rate = 1000, per_decade = 20;
  const auto rows = recorded(RecordedRows({.rate = 0, .per_decade = per_decade}, rate), 1'000'000);
  EXPECT_EQ(rows[0], 1U);
  EXPECT_EQ(rows[7], 8U);  // 12 % of 8 samples is less than a sample
  const auto between = [&](double from, double to) {
    return std::ranges::count_if(
        rows, [&](auto r) { return static_cast<double>(r) > from && static_cast<double>(r) <= to; });
  };
  for (const double decade : {1e2, 1e3, 1e4}) EXPECT_NEAR(between(decade, 10 * decade), per_decade, 3);
  for (std::size_t i = 1; i < rows.size(); ++i) EXPECT_LE(rows[i] - rows[i - 1], 10 * rate);
  EXPECT_EQ(rows.back(), 1'000'000U);
}

TEST(RecordedRows, AreCountedWithoutGoingThroughThem) {
  for (const double own : {0.0, 0.02, 3.0, 70.0, 999.0})
    for (const double per_decade : {0.0, 1.0, 7.0, 50.0, 3000.0})
      for (const std::uint64_t samples : {1, 2, 9, 100, 1234, 50'000, 300'001}) {
        const RecordedRows rows({own, per_decade}, 1000);
        EXPECT_EQ(rows.count(samples), recorded(rows, samples).size())
            << own << " Hz, " << per_decade << " a decade, " << samples;
      }
  EXPECT_EQ(RecordedRows().count(0), 0U);
  // Four months at 1 MHz.
  EXPECT_NEAR(static_cast<double>(RecordedRows({0, 100}, 1e6).count(10'000'000'000'000)), 1e6, 2e3);
}

TEST(RecordedRows, AreAskedForBySegmentsAndByTheRepeatsAroundThem) {
  const auto w = Protocol::from_json(program(nlohmann::json::parse(R"([
      {"kind": "ramp", "to": 1, "rate": 1},
      {"kind": "repeat", "count": 2, "sample_rate_Hz": 50, "readings_per_decade": 30, "segments": [
        {"kind": "ramp", "to": 0, "rate": 1, "sample_rate_Hz": 400}, {"kind": "hold", "time": 1}]},
      {"kind": "hold", "time": 1, "readings_per_decade": 10}])")))
                     .expand();
  ASSERT_EQ(w.pieces().size(), 5U);
  const auto asked = [&](std::size_t i) {
    return std::pair(w.pieces()[i].recorded.rate, w.pieces()[i].recorded.per_decade);
  };
  EXPECT_EQ(asked(0), std::pair(0.0, 0.0));
  EXPECT_EQ(asked(1), std::pair(400.0, 0.0));
  EXPECT_EQ(asked(2), std::pair(50.0, 30.0));
  EXPECT_EQ(asked(3), std::pair(50.0, 30.0));  // the second ramp goes nowhere
  EXPECT_EQ(asked(4), std::pair(0.0, 10.0));
  EXPECT_EQ(w.fastest_recorded(), 400);

  const SampledWaveform sampled(w, 400, 100);
  EXPECT_EQ(sampled.recorded_rate(0), 100);
  EXPECT_EQ(sampled.recorded_rate(1), 400);
  EXPECT_EQ(sampled.recorded_rate(2), 50);
  std::uint64_t rows = 1;
  for (std::size_t i = 0; i < 5; ++i)
    rows += recorded(sampled.recorded_rows(i), sampled.corners()[i + 1] - sampled.corners()[i]).size();
  EXPECT_EQ(sampled.recorded_size(), rows);
}

TEST(RecordedRows, OfASmallSignalResolveItsSine) {
  auto segment = nlohmann::json::parse(R"({"kind": "small_signal", "levels": [1, 2], "rate": 1, "settle": 1,
      "amplitude": 0.1, "frequency": 10, "cycles": 5, "sample_rate_Hz": 150})");
  const auto found = validate(program({segment}));
  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(found[0].path, "/segments/0/sample_rate_Hz");
  segment["sample_rate_Hz"] = 200;
  EXPECT_TRUE(validate(program({segment})).empty());
}

TEST(RecordedRows, LeaveTheUsualRateToTheOtherSegments) {
  const auto slow = Protocol::from_json(program(nlohmann::json::parse(R"([
      {"kind": "ramp", "to": 1, "rate": 100, "sample_rate_Hz": 50000}, {"kind": "ramp", "to": 0, "rate": 1}])")));
  EXPECT_EQ(slow.sample_rate(), 500);
}

}  // namespace
}  // namespace ferrobench::protocols

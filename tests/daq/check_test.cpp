#include "daq/guard/check.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include "daq/guard/reverse_time.h"
#include "programs.h"
#include "protocols/protocol.h"

namespace ferrobench::daq {
namespace {

TEST(Check, PassesWhatIsExactlyAtTheLimits) {
  const Limits limits;
  EXPECT_TRUE(
      check(program({line(0, 1.6e6, 0.016), line(1.6e6, 1.6e6, 1), line(1.6e6, -1.6e6, 0.032)}, 1000), limits)
          .empty());
}

TEST(Check, NamesEverySegmentThatIsWrongAndWhatIsAllowed) {
  Limits limits;
  limits.slew = 1e6;
  const auto found = check(
      program({line(0, 2e6, 1), line(2e6, 0, 10), line(0, -1.7e6, 5), line(-1.7e6, 0, 5)}, 100), limits);
  std::vector<std::string> paths;
  for (const auto& p : found) paths.push_back(p.path);
  EXPECT_EQ(paths, (std::vector<std::string>{"/segments/0/level", "/segments/0/rate", "/segments/1/level",
                                             "/segments/2/level", "/segments/3/level"}));
  EXPECT_EQ(found[0].given, 2e6);
  EXPECT_EQ(found[0].allowed, (nlohmann::json{{"from", -1.6e6}, {"to", 1.6e6}}));
  EXPECT_EQ(found[0].unit, "V/m");
  EXPECT_NE(found[0].message.find("segment 0"), std::string::npos);
  EXPECT_EQ(found[1].given, 2e6);
  EXPECT_EQ(found[1].allowed, (nlohmann::json{{"to", 1e6}}));
  EXPECT_FALSE(found[1].hint.empty());
}

// Three cycles are six rows of the segment table and one segment of the author's.
TEST(Check, TellsEachProblemOnceInTheUnitAndAtThePlaceOfTheAuthor) {
  const auto found_in = [](const char* unit, double high, double rate) {
    const auto protocol = protocols::Protocol::from_json(
        {{"format", "ferrobench-protocol"},
         {"version", 1},
         {"name", "cycles"},
         {"unit", unit},
         {"layer_thickness_m", 1e-4},
         {"segments",
          {{{"kind", "hold"}, {"time", 1}},
           {{"kind", "triangle"}, {"low", 0}, {"high", high}, {"rate", rate}, {"cycles", 3}}}}});
    return check(protocols::SampledWaveform(protocol.expand(), 100000), Limits{});
  };
  const auto volts = found_in("V", 200, 20000);
  ASSERT_EQ(volts.size(), 2U);
  EXPECT_EQ(volts[0].path, "/segments/1/level");
  EXPECT_EQ(volts[0].unit, "V");
  EXPECT_NEAR(volts[0].given.get<double>(), 200, 1e-9);
  EXPECT_NEAR(volts[0].allowed["to"].get<double>(), 160, 1e-9);
  EXPECT_EQ(volts[1].path, "/segments/1/rate");
  EXPECT_EQ(volts[1].unit, "V/s");
  EXPECT_NEAR(volts[1].allowed["to"].get<double>(), 10000, 1e-6);
  const auto field = found_in("kV/mm", 1, 1000);
  ASSERT_EQ(field.size(), 1U);
  EXPECT_EQ(field[0].unit, "kV/mm/s");
  EXPECT_NEAR(field[0].given.get<double>(), 1000, 1);
  EXPECT_EQ(field[0].allowed, (nlohmann::json{{"to", 100.0}}));
}

TEST(Check, OfSeveralBadPiecesTheWorstIsTold) {
  const auto protocol = protocols::Protocol::from_json(
      {{"format", "ferrobench-protocol"},
       {"version", 1},
       {"name", "points"},
       {"unit", "kV/mm"},
       {"segments", {{{"kind", "points"}, {"points", {{0, 0}, {1, 2}, {2, 5}, {3, 3}, {4, 0}}}}}}});
  const auto found = check(protocols::SampledWaveform(protocol.expand(), 100), Limits{});
  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(found[0].given, 5.0);
  EXPECT_NE(found[0].message.find("\"point 3\""), std::string::npos) << found[0].message;
}

TEST(Check, SeesACrestBetweenTwoSamples) {
  // A quarter period a sample, a little off the crests.
  const auto found = check(program({sine(0, 1.7e6, 1, 1)}, 4), Limits{});
  ASSERT_EQ(found.size(), 1U);
  EXPECT_NEAR(found[0].given.get<double>(), 1.7e6, 1);
}

TEST(Check, RefusesAJump) {
  const auto found = check(program({line(0, 0, 1), line(1e5, 1e5, 1)}, 10), Limits{});
  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(found[0].path, "/segments/1/start");
}

TEST(Check, CountsReverseTimeAcrossSegments) {
  Limits limits;
  limits.reverse_field_threshold = -1e5;
  limits.reverse_field_time = 3;
  // Half of each ramp is below the threshold.
  const auto within = program({line(0, -2e5, 2), line(-2e5, -2e5, 1), line(-2e5, 0, 2)}, 100);
  EXPECT_TRUE(check(within, limits).empty());
  limits.reverse_field_time = 2.99;
  const auto found = check(within, limits);
  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(found[0].path, "/segments/2/level");
  EXPECT_NEAR(found[0].given.get<double>(), 3, 1e-9);
}

// Times below the threshold by sampling, for a sine cut anywhere.
RC_GTEST_PROP(ReverseTime, OfASineIsThatOfItsSamples, ()) {
  const auto real = [](double from, double to) {
    return from + (to - from) * (*rc::gen::inRange(0, 1 << 20)) / (1 << 20);
  };
  const double duration = real(0.1, 5);
  const auto piece = sine(real(-1, 1), real(-2, 2), real(0.01, 3), duration, real(-10, 10));
  const double threshold = real(-2, 2);
  const auto exact = time_below(piece, duration, threshold);

  constexpr int steps = 20000;
  const auto below_at = [&](double share) { return piece.value(share * duration) < threshold; };
  double run = 0, first = -1, longest = 0;
  bool whole = true;
  for (int i = 0; i < steps; ++i) {
    if (below_at((i + 0.5) / steps)) {
      run += duration / steps;
      longest = std::max(longest, run);
    } else {
      if (first < 0) first = run;
      run = 0;
      whole = false;
    }
  }
  const double near = 3 * duration / steps;
  RC_CLASSIFY(exact.longest > 0);
  // A crest that only just crosses is seen by one of the two alone, and so is a crossing before the first
  // sample or after the last.
  const double q = (threshold - piece.center) / piece.amplitude;
  if (std::abs(std::abs(q) - 1) < 1e-3) return;
  if (below_at(0) != below_at(0.5 / steps) || below_at(1 - 0.5 / steps) != below_at(1)) return;
  RC_ASSERT(std::abs(exact.longest - longest) <= near);
  RC_ASSERT(exact.whole == whole);
  if (whole) return;
  RC_ASSERT(std::abs(exact.at_start - first) <= near);
  RC_ASSERT(std::abs(exact.at_end - run) <= near);
}

}  // namespace
}  // namespace ferrobench::daq

// What each kind of segment turns into: levels, times, labels.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "tests/protocols/programs.h"

namespace ferrobench::protocols {
namespace {

using nlohmann::json;
using testing::DoubleNear;
using testing::ElementsAre;
using testing::Pointwise;
using testing::StartsWith;

auto near(std::vector<double> values) {
  return Pointwise(testing::DoubleNear(1e-9), std::move(values));
}

TEST(Ramp, GoesAtARateOrInATime) {
  const auto w =
      expanded({{{"kind", "ramp"}, {"to", 1.5}, {"rate", 0.5}}, {{"kind", "ramp"}, {"to", -1}, {"time", 2}}});
  EXPECT_THAT(corner_levels(w), near({0, 1.5, -1}));
  EXPECT_THAT(durations(w), near({3, 2}));
  EXPECT_THAT(labels(w), ElementsAre("ramp 1 up", "ramp 2 down"));
  EXPECT_EQ(w.segments()[0].kind, "ramp");
  EXPECT_EQ(w.segments()[0].rate, 0.5e6);
  EXPECT_EQ(w.segments()[1].rate, 1.25e6);
  EXPECT_EQ(w.segments()[1].level, -1e6);
}

TEST(Ramp, ToTheLevelItIsAtTakesNoTimeUnlessTimeWasAskedFor) {
  const auto w = expanded({{{"kind", "ramp"}, {"to", 1}, {"rate", 5}},
                           {{"kind", "ramp"}, {"to", 1}, {"time", 2}},
                           {{"kind", "ramp"}, {"to", 0}, {"rate", 1}}},
                          1);
  EXPECT_THAT(durations(w), near({2, 1}));
  EXPECT_THAT(labels(w), ElementsAre("wait", "ramp 1 down"));
  EXPECT_EQ(w.segments()[0].kind, "hold");
}

TEST(Hold, StaysAndIsNumbered) {
  const auto w = expanded({{{"kind", "hold"}, {"time", 3}},
                           {{"kind", "hold"}, {"time", 0}},
                           {{"kind", "hold"}, {"time", 1}},
                           {{"kind", "hold"}, {"time", 1}, {"label", "rest"}}},
                          0.25);
  EXPECT_THAT(corner_levels(w), near({0.25, 0.25, 0.25, 0.25}));
  EXPECT_THAT(labels(w), ElementsAre("hold 1", "hold 2", "rest"));
  EXPECT_EQ(w.segments()[2].rate, 0);
}

TEST(Repeat, RepeatsWhatIsNested) {
  const json inner = {{{"kind", "ramp"}, {"to", 1}, {"rate", 1}}, {{"kind", "ramp"}, {"to", 0}, {"rate", 1}}};
  const json block = {{{"kind", "repeat"}, {"count", 2}, {"segments", inner}, {"label", "pass"}}};
  const auto w = expanded({{{"kind", "repeat"}, {"count", 2}, {"segments", block}}});
  EXPECT_THAT(corner_levels(w), near({0, 1, 0, 1, 0, 1, 0, 1, 0}));
  EXPECT_THAT(labels(w), ElementsAre("pass 1: ramp 1 up", "pass 1: ramp 2 down", "pass 2: ramp 3 up",
                                     "pass 2: ramp 4 down", "pass 1: ramp 5 up", "pass 1: ramp 6 down",
                                     "pass 2: ramp 7 up", "pass 2: ramp 8 down"));
}

TEST(Reversals, OfFirstOrderComeBackAndRest) {
  const auto w = expanded({{{"kind", "reversals"},
                            {"points", {0, -0.5}},
                            {"rate", 0.5},
                            {"hold", 15},
                            {"back_to", 1.5},
                            {"hold_back", 5}}},
                          1.5);
  EXPECT_THAT(corner_levels(w), near({1.5, 0, 0, 1.5, 1.5, -0.5, -0.5, 1.5, 1.5}));
  EXPECT_THAT(durations(w), near({3, 15, 3, 5, 4, 15, 4, 5}));
  EXPECT_THAT(labels(w), ElementsAre("reversal 1 down", "hold 1", "reversal 1 up", "reversal 1 rest",
                                     "reversal 2 down", "hold 2", "reversal 2 up", "reversal 2 rest"));
}

TEST(Reversals, WithoutALevelToComeBackToGoFromPointToPoint) {
  const auto w =
      expanded({{{"kind", "reversals"}, {"points", {1, -1, 0.5}}, {"rate", 1}, {"label", "nest"}}});
  EXPECT_THAT(corner_levels(w), near({0, 1, -1, 0.5}));
  EXPECT_THAT(labels(w), ElementsAre("nest: reversal 1 up", "nest: reversal 2 down", "nest: reversal 3 up"));
}

TEST(Reversals, ByCountAreEvenlySpacedWithBothEnds) {
  const json family = {{"kind", "reversals"}, {"count", 4}, {"first", 1},
                       {"last", -0.5},        {"rate", 1},  {"back_to", 1.5}};
  const auto w = expanded(json::array({family}), 1.5);
  EXPECT_THAT(corner_levels(w), near({1.5, 1, 1.5, 0.5, 1.5, 0, 1.5, -0.5, 1.5}));
}

TEST(Reversals, OfSecondOrderGoToTheirBaseFirst) {
  const json loops = {{"kind", "reversals"}, {"order", 2}, {"points", {25, 50}}, {"rate", 5}, {"back_to", 0}};
  const auto w = expanded(json::array({loops}), 150);
  EXPECT_THAT(corner_levels(w), near({150, 0, 25, 0, 50, 0}));
  EXPECT_THAT(labels(w), ElementsAre("approach", "reversal 1 up", "reversal 1 down", "reversal 2 up",
                                     "reversal 2 down"));
}

TEST(Reversals, OfThirdOrderTurnTwice) {
  const json loops = {{"kind", "reversals"}, {"order", 3},   {"points", {125, 0}}, {"rate", 5},
                      {"rise", 25},          {"through", 0}, {"back_to", 150},     {"hold_back", 5}};
  const auto w = expanded(json::array({loops}), 150);
  EXPECT_THAT(corner_levels(w), near({150, 125, 150, 0, 150, 150, 0, 25, 0, 150, 150}));
  EXPECT_THAT(labels(w), ElementsAre("reversal 1 down", "reversal 1 up", "reversal 1 down 2",
                                     "reversal 1 up 2", "reversal 1 rest", "reversal 2 down", "reversal 2 up",
                                     "reversal 2 down 2", "reversal 2 up 2", "reversal 2 rest"));
}

TEST(Triangle, LeavesItsOwnLevelAndComesBack) {
  json triangle = {{"kind", "triangle"}, {"low", -1.5}, {"high", 1.5}, {"rate", 3}, {"cycles", 2}};
  EXPECT_THAT(corner_levels(expanded(json::array({triangle}), -1.5)), near({-1.5, 1.5, -1.5, 1.5, -1.5}));
  EXPECT_THAT(corner_levels(expanded(json::array({triangle}), 1.5)), near({1.5, -1.5, 1.5, -1.5, 1.5}));
  EXPECT_THAT(corner_levels(expanded(json::array({triangle}), 3)), near({3, 1.5, -1.5, 1.5, -1.5, 1.5}));
  const auto w = expanded(json::array({triangle}), 0.5);
  EXPECT_THAT(corner_levels(w), near({0.5, 1.5, -1.5, 0.5, 1.5, -1.5, 0.5}));
  EXPECT_THAT(labels(w), ElementsAre("cycle 1 up", "cycle 1 down", "cycle 1 up 2", "cycle 2 up",
                                     "cycle 2 down", "cycle 2 up 2"));
  triangle["first"] = "down";
  EXPECT_THAT(corner_levels(expanded(json::array({triangle}), 0.5)),
              near({0.5, -1.5, 1.5, 0.5, -1.5, 1.5, 0.5}));
}

TEST(Triangle, ByFrequencyTakesWholePeriods) {
  const json triangle = {{"kind", "triangle"}, {"low", 0}, {"high", 150}, {"frequency", 0.25}, {"cycles", 3}};
  const auto w = expanded(json::array({triangle}));
  EXPECT_THAT(durations(w), near({2, 2, 2, 2, 2, 2}));
  EXPECT_THAT(w.max_slew(), DoubleNear(75e6, 1e-3));
}

TEST(Sine, IsOnePieceAfterItsApproach) {
  const json sine = {{"kind", "sine"}, {"center", 0.5},  {"amplitude", 1},
                     {"frequency", 2}, {"cycles", 2.25}, {"phase", 90}};
  const auto w = expanded(json::array({sine, {{"kind", "hold"}, {"time", 1}}}));
  EXPECT_THAT(labels(w), ElementsAre("sine approach", "sine", "hold 1"));
  EXPECT_THAT(corner_levels(w), near({0, 1.5, 0.5, 0.5}));
  const double approach = 1.5 / (4 * M_PI);
  EXPECT_THAT(durations(w), near({approach, 1.125, 1}));
  EXPECT_NEAR(w.value(approach + 0.25), -0.5e6, 1e-6);
  EXPECT_NEAR(w.value(approach + 0.5), 1.5e6, 1e-6);
  EXPECT_NEAR(w.minimum(), -0.5e6, 1e-6);
  EXPECT_NEAR(w.max_slew(), 4e6 * M_PI, 1e-3);
}

TEST(Pund, IsAPresetThenTwoUpAndTwoDown) {
  const json pund = {{"kind", "pund"}, {"amplitude", 2}, {"width", 0.5}, {"delay", 1}, {"rise", 0.1}};
  const auto w = expanded(json::array({pund}));
  EXPECT_THAT(corner_levels(w), near({0, -2, -2, 0, 0, 2, 2, 0, 0, 2, 2, 0, 0, -2, -2, 0, 0, -2, -2, 0, 0}));
  EXPECT_NEAR(w.duration(), 5 * 1.7, 1e-9);
  EXPECT_EQ(w.max_slew(), 20e6);
  EXPECT_EQ(w.segments()[0].label, "preset pulse rise");
  EXPECT_EQ(w.segments()[5].label, "pulse P");
  EXPECT_EQ(w.segments()[10].label, "pulse U fall");
  EXPECT_EQ(w.segments()[19].label, "pulse D delay");
}

TEST(SmallSignal, IsAStaircaseWithASineOnEachStep) {
  const json steps = {{"kind", "small_signal"}, {"levels", {1, 0.5, 0.5}}, {"rate", 2},  {"settle", 3},
                      {"amplitude", 0.1},       {"frequency", 4},          {"cycles", 8}};
  const auto w = expanded(json::array({steps}));
  EXPECT_THAT(corner_levels(w), near({0, 1, 1, 1, 0.5, 0.5, 0.5, 0.5, 0.5}));
  EXPECT_THAT(durations(w), near({0.5, 3, 2, 0.25, 3, 2, 3, 2}));
  EXPECT_THAT(labels(w), ElementsAre("bias 1 up", "bias 1 settle", "bias 1 sine", "bias 2 down",
                                     "bias 2 settle", "bias 2 sine", "bias 3 settle", "bias 3 sine"));
  EXPECT_NEAR(w.value(3.5 + 1.0 / 16), 1.1e6, 1e-3) << "rises from the bias";
  EXPECT_NEAR(w.maximum(), 1.1e6, 1e-3);
  EXPECT_NEAR(w.sampling(), 80, 1e-9);
}

TEST(SmallSignal, BringsASampleRateThatResolvesIt) {
  json given = program({{{"kind", "small_signal"},
                         {"levels", {1, -1}},
                         {"rate", 0.01},
                         {"settle", 1},
                         {"amplitude", 1e-6},
                         {"frequency", 100}}});
  EXPECT_GE(Protocol::from_json(given).sample_rate().value(), 2000);
  given["sample_rate_Hz"] = 2000;
  EXPECT_EQ(Protocol::from_json(given).sample_rate(), 2000);
  given["sample_rate_Hz"] = 1999;
  const auto problems = validate(given);
  ASSERT_EQ(problems.size(), 1U);
  EXPECT_EQ(problems[0].path, "/sample_rate_Hz");
  EXPECT_EQ(problems[0].allowed["from"], 2000);
}

TEST(Points, GoStraightFromOneToTheNext) {
  const json rows = {{0, 0}, {1, 2}, {3, 2}, {4, -1}};
  const auto w = expanded({{{"kind", "points"}, {"points", rows}}});
  EXPECT_THAT(corner_levels(w), near({0, 2, 2, -1}));
  EXPECT_THAT(durations(w), near({1, 2, 1}));
  EXPECT_THAT(labels(w), ElementsAre("point 2", "point 3", "point 4"));
  EXPECT_EQ(w.segments()[1].kind, "hold");

  const std::string text =
      "\xef\xbb\xbftime;level\r\n# made by hand\r\n0;0\r\n\r\n1;2 # top\r\n3;+2\n4 ; -1e0";
  const auto same = expanded({{{"kind", "points"}, {"csv", text}}});
  EXPECT_THAT(corner_levels(same), near({0, 2, 2, -1}));
}

TEST(Points, AreApproachedBeforeTheyStart) {
  const auto until = expanded({{{"kind", "points"}, {"points", {{2, 1}, {3, 0}}}}});
  EXPECT_THAT(durations(until), near({2, 1}));
  const auto ahead = expanded({{{"kind", "points"}, {"points", {{0, 1}, {1, 0}, {2, 4}}}}});
  EXPECT_THAT(corner_levels(ahead), near({0, 1, 0, 4}));
  EXPECT_THAT(durations(ahead), near({0.25, 1, 1}));
  EXPECT_THAT(labels(ahead).front(), StartsWith("approach"));
}

}  // namespace
}  // namespace ferrobench::protocols

// Uncertainties of figures: the law of propagation against brute force, how they are written, where they
// stand. That they cover the truth is tested where a virtual bench is at hand
// (tests/daq/uncertainty_test.cpp).
#include "recordings/analysis/uncertainty.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "recordings/analysis/signals.h"
#include "recordings/reports/report.h"
#include "tests/recordings/sample.h"

namespace ferrobench::recordings {
namespace {

using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::Not;

// sum over i, j of w_i w_j c(|i - j|), written out.
double double_sum(const std::vector<Weight>& weights, double white, double slow, double rows) {
  double sum = 0;
  for (const auto& a : weights)
    for (const auto& b : weights) {
      const double apart = std::abs(static_cast<double>(a.sample) - static_cast<double>(b.sample));
      sum += a.weight * b.weight * ((apart == 0 ? white : 0) + slow * std::exp(-apart / rows));
    }
  return sum;
}

TEST(Noise, PropagatesAsTheDoubleSumDoes) {
  const Noise noise(2, {.slow_share = 0.75, .rows = 4}, 0);
  std::mt19937 random(1);
  std::vector<Weight> weights;
  for (int i = 0; i < 60; ++i)  // in no order, some samples twice
    weights.push_back({random() % 80, std::uniform_real_distribution<double>(-1, 1)(random)});
  const double expected = double_sum(weights, 1, 3, 4);
  EXPECT_NEAR(noise.variance(weights), expected, 1e-12 * expected);

  std::vector<Weight> even;
  for (std::size_t i = 0; i < 37; ++i) even.push_back({i, 1.0 / 37});
  EXPECT_NEAR(noise.variance_of_mean(37), double_sum(even, 1, 3, 4), 1e-12);

  // Weights that change slowly: a half wave over 4000 samples.
  std::vector<Weight> slow;
  double squares = 0;
  for (std::size_t i = 0; i < 4000; ++i) {
    slow.push_back({i, std::sin(3.14159 * static_cast<double>(i) / 4000)});
    squares += slow.back().weight * slow.back().weight;
  }
  EXPECT_NEAR(noise.variance_of_sum(squares) / double_sum(slow, 1, 3, 4), 1, 1e-3);
}

TEST(Noise, LessThanHalfACountOfItLeavesTheRounding) {
  std::vector<Weight> weights;
  for (std::size_t i = 0; i < 20; ++i) weights.push_back({i, 1.0 / 20});
  const double rounding = 1 / std::sqrt(12.0);
  const double alone = std::sqrt(Noise(0, {}, 1).variance(weights));
  EXPECT_LT(alone, rounding);  // the same in all of a narrow window, and hardly averaged out
  EXPECT_GT(alone, 0.9 * rounding);
  EXPECT_NEAR(std::sqrt(Noise(1, {}, 1).variance(weights)), 1 / std::sqrt(20.0), 1e-12);
}

TEST(Readings, ASampleInTwoOfThemCountsWithItsSigns) {
  const Reading a{5, {{3, 1}}}, b{2, {{7, 1}}}, c{1, {{3, 1}}};
  const Noise noise(1, {}, 0);
  EXPECT_DOUBLE_EQ(noise.variance((a - b).weights), 2);
  EXPECT_DOUBLE_EQ(noise.variance((a - c).weights), 0);
  EXPECT_DOUBLE_EQ(noise.variance((a + c).weights), 4);
  EXPECT_DOUBLE_EQ(noise.variance((0.5 * (a + b)).weights), 0.5);
  EXPECT_DOUBLE_EQ(abs(b - a).value, 3);
}

TEST(WithUncertainty, PrintsTheLastDigits) {
  EXPECT_EQ(with_uncertainty(41.594, 0.038), "41.59(4)");
  EXPECT_EQ(with_uncertainty(41.594, 0.0121), "41.594(12)");  // two digits where the first is 1 or 2
  EXPECT_EQ(with_uncertainty(-0.3012, 0.0031), "-0.301(3)");
  EXPECT_EQ(with_uncertainty(2, 0.0996), "2.00(10)");
  EXPECT_EQ(with_uncertainty(1234, 47), "1230(50)");
  EXPECT_EQ(with_uncertainty(1234.4, 0.9), "1234.4(9)");
  EXPECT_EQ(with_uncertainty(1234.4, 3), "1234(3)");
  EXPECT_EQ(with_uncertainty(0.02, 0.5), "0.0(5)");
  EXPECT_EQ(with_uncertainty(0, 3e-9), "0(3)e-09");
  EXPECT_EQ(with_uncertainty(1.2344e-6, 5e-9), "1.234(5)e-06");
  EXPECT_EQ(with_uncertainty(-2.5e9, 4e6), "-2.500(4)e+09");
  EXPECT_EQ(with_uncertainty(0.12345, 0), "0.1235") << "none is known";
  EXPECT_EQ(with_uncertainty(0.12345, std::nan("")), "0.1235");
}

// Two triangles of a linear actuator, 12 um.
Recording triangles(double noise) {
  auto r = testing::play(0, {{1.5e6, 3}, {0, 3}, {1.5e6, 3}, {0, 3}}, 1000);
  r.header.device = {{"channels", {{{"channel", "displacement"}, {"gain_uncertainty", 0.01}}}}};
  auto& x = r.set(Channel::displacement);
  std::mt19937 random(7);
  std::normal_distribution<double> normal(0, noise);
  for (const double e : r.at(Channel::command)) x.push_back(8e-12 * e + (noise > 0 ? normal(random) : 0));
  return r;
}

double uncertainty_of_stroke(const Recording& r) {
  const auto table = nlohmann::json::parse(render(make_report(r), Format::json))["stroke"];
  return table["rows"][0]["stroke_um_uncertainty"];
}

TEST(Uncertainty, HasTheCalibrationThatTheFileStates) {
  auto r = triangles(1e-9);
  EXPECT_NEAR(uncertainty_of_stroke(r), 0.12, 0.001) << "1 % of 12 um";
  r.header.device = {{"driver", "replay"}, {"recorded_with", r.header.device}};
  EXPECT_NEAR(uncertainty_of_stroke(r), 0.12, 0.001);
  for (const auto* other : {R"({"channels": [{"channel": "displacement", "gain_uncertainty": "much"}]})",
                            R"({"channels": [{"channel": "displacement", "gain_uncertainty": -0.1}]})",
                            R"({"channels": [{"channel": "force", "gain_uncertainty": 0.1}]})", "3"}) {
    r.header.device = nlohmann::json::parse(other);
    EXPECT_LT(uncertainty_of_stroke(r), 0.001) << other;
  }
}

TEST(Uncertainty, GrowsWithTheNoise) {
  auto once = triangles(2e-8), twice = triangles(4e-8);
  once.header.device = twice.header.device = {};
  EXPECT_NEAR(uncertainty_of_stroke(twice) / uncertainty_of_stroke(once), 2, 0.3);
}

TEST(Uncertainty, StandsBesideTheFigureInEveryFormat) {
  const auto r = triangles(2e-8);
  const auto report = make_report(r);
  const auto json = nlohmann::json::parse(render(report, Format::json))["stroke"];
  std::map<std::string, std::string> keys;
  for (const auto& column : json["columns"])
    if (column.contains("uncertainty")) keys[column["key"]] = column["uncertainty"];
  EXPECT_THAT(keys, ::testing::ElementsAre(std::pair("strain_percent", "strain_percent_uncertainty"),
                                           std::pair("stroke_um", "stroke_um_uncertainty")));
  const auto& row = json["rows"][0];
  const double value = row["stroke_um"], u = row["stroke_um_uncertainty"];
  // The strain of 18 mm.
  EXPECT_NEAR(row["strain_percent_uncertainty"].get<double>() / u,
              row["strain_percent"].get<double>() / value, 1e-9);
  const auto shown = with_uncertainty(value, u);
  EXPECT_THAT(shown, HasSubstr("("));
  for (const auto format : {Format::text, Format::html})
    EXPECT_THAT(render(report, format), ::testing::AllOf(HasSubstr(shown), HasSubstr("(k = 2)")));
  EXPECT_THAT(render(report, Format::md), HasSubstr(shown));
  const auto csv = render(report, Format::csv);
  EXPECT_THAT(csv, HasSubstr("stroke_um,stroke_um_uncertainty,strain_percent,strain_percent_uncertainty,"));
  EXPECT_THAT(json["notes"].dump(), HasSubstr("k = 2"));
}

TEST(Uncertainty, IsNotStatedOfWhatWasSimulatedWithoutNoise) {
  auto r = triangles(0);
  r.header.device = {};
  const auto report = make_report(r);
  for (const auto& table : report.tables) EXPECT_TRUE(table.uncertainty.empty()) << table.key;
  EXPECT_THAT(render(report, Format::text), Not(HasSubstr("k = 2")));
}

}  // namespace
}  // namespace ferrobench::recordings

// The small-signal response against closed forms: a linear capacitor, alone and behind a lag, a leak, a
// resistance; and the stated uncertainties against 200 virtual benches with noise.
#include "recordings/analysis/small_signal.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <iostream>
#include <numbers>

#include "daq/guard/check.h"
#include "daq/virtual/config.h"
#include "model/simulator.h"
#include "protocols/protocol.h"
#include "recordings/reports/figures.h"
#include "recordings/reports/report.h"
#include "tests/daq/coverage.h"

namespace ferrobench::daq {
namespace {

using recordings::Approach;
using recordings::Channel;
using recordings::Estimate;
using recordings::Recording;
using recordings::SmallSignalPoint;

constexpr double frequency = 10, omega = 2 * std::numbers::pi * frequency;
constexpr double vacuum_permittivity = 8.8541878128e-12;

nlohmann::json staircase(int cycles) {
  return {{"format", "ferrobench-protocol"},
          {"version", 1},
          {"name", "staircase"},
          {"unit", "kV/mm"},
          {"segments",
           {{{"kind", "small_signal"},
             {"levels", {0.5, -0.5, 0}},
             {"rate", 2},
             {"settle", 0.2},
             {"amplitude", 0.02},
             {"frequency", frequency},
             {"cycles", cycles}}}}};
}

nlohmann::json effect(const char* id, const char* parameter, double value) {
  return nlohmann::json::array({{{"id", id}, {"parameters", {{parameter, value}}}}});
}

model::Model capacitor(const nlohmann::json& effects = nlohmann::json::array()) {
  auto json = model::to_json(model::library_model("linear-capacitor"));
  json["effects"] = effects;
  return model::model_from_json(json);
}

// As a run makes it, without noise.
Recording played(const model::Model& model, const nlohmann::json& json, double rate) {
  const auto protocol = protocols::Protocol::from_json(json);
  const protocols::SampledWaveform program(protocol.expand(), rate);
  Recording r;
  r.header.protocol = json;
  r.header.specimen = {model.name, model.actuator.length, model.actuator.area, model.actuator.layer_thickness,
                       model.actuator.layer_count};
  auto& command = r.set(Channel::command);
  command.resize(program.size());
  program.fill(0, command);
  for (std::size_t i = 0; i < program.size(); ++i) r.time.push_back(static_cast<double>(i) / rate);
  const auto rows = program.waveform().segments();
  for (std::size_t k = 0; k < rows.size(); ++k)
    r.segments.push_back({static_cast<std::int64_t>(program.corners()[k]),
                          static_cast<std::int64_t>(program.corners()[k + 1]), rows[k].kind, rows[k].label,
                          rows[k].level, rows[k].rate});
  auto t = model::simulate(model, r.time, command, {.tolerance = 1e-6});
  r.set(Channel::field) = std::move(t.field);
  r.set(Channel::charge) = std::move(t.charge);
  r.set(Channel::displacement) = std::move(t.displacement);
  r.set(Channel::force) = std::move(t.force);
  r.noise.fill(0);
  return r;
}

constexpr double fine = 400 * frequency;  // samples a second

void expect_figures(const std::vector<SmallSignalPoint>& points, double capacitance, double tan_delta,
                    double d33, double phase) {
  ASSERT_EQ(points.size(), 3U);
  for (const auto& p : points) {
    SCOPED_TRACE(p.sine.bias);
    EXPECT_NEAR(p.frequency, frequency, 1e-9);
    EXPECT_NEAR(p.amplitude, 2e4, 1e-3 * 2e4);
    EXPECT_NEAR(p.capacitance->value, capacitance, 1e-4 * capacitance);
    EXPECT_NEAR(p.tan_delta->value, tan_delta, 1e-4);
    EXPECT_NEAR(p.d33->value, d33, 1e-4 * d33);
    EXPECT_NEAR(p.phase->value, phase, 0.01);
  }
}

constexpr double permittivity = 2.5e-8, area = 100 * 2.5e-5, thickness = 1e-4, d33 = 5.5e-10;
constexpr double capacitance = permittivity * area / thickness;

TEST(SmallSignal, OfALinearCapacitorIsItsOwn) {
  const auto points = find_small_signal(played(capacitor(), staircase(6), fine));
  expect_figures(points, capacitance, 0, d33, 0);
  const double biases[] = {5e5, -5e5, 0};
  const Approach ways[] = {Approach::up, Approach::down, Approach::up};
  for (std::size_t k = 0; k < 3; ++k) {
    EXPECT_NEAR(points[k].sine.bias, biases[k], 1);
    EXPECT_EQ(points[k].sine.approach, ways[k]);
    EXPECT_NEAR(points[k].permittivity->value, permittivity / vacuum_permittivity, 0.1);
    EXPECT_EQ(points[k].capacitance->uncertainty(), 0) << "nothing is known without noise";
  }
}

TEST(SmallSignal, ALeakIsALoss) {
  constexpr double resistivity = 1e8;
  expect_figures(find_small_signal(played(capacitor(effect("dielectric_leakage", "resistivity", resistivity)),
                                          staircase(6), fine)),
                 capacitance, 1 / (resistivity * omega * permittivity), d33, 0);
}

TEST(SmallSignal, ALagHasItsGainAndPhase) {
  constexpr double tau = 0.01;
  expect_figures(find_small_signal(
                     played(capacitor(effect("displacement_lag", "time_constant", tau)), staircase(6), fine)),
                 capacitance, 0, d33 / std::hypot(1, omega * tau),
                 -std::atan(omega * tau) * 180 / std::numbers::pi);
}

// C / (1 + i w R C): the monitor is ahead of the resistance.
TEST(SmallSignal, AResistanceBehindTheMonitorIsInTheFigures) {
  constexpr double coefficient = 1e5, share = omega * coefficient * permittivity;
  const auto points = find_small_signal(
      played(capacitor(effect("source_resistance", "coefficient", coefficient)), staircase(6), fine));
  expect_figures(points, capacitance / (1 + share * share), share, d33 / std::hypot(1, share),
                 -std::atan(share) * 180 / std::numbers::pi);
}

// The field is measured behind the amplifier.
TEST(SmallSignal, AnAmplifierThatLagsIsInNone) {
  auto json = staircase(6);
  const auto points =
      find_small_signal(played(capacitor(effect("amplifier_lag", "time_constant", 2e-3)), json, fine));
  ASSERT_EQ(points.size(), 3U);
  for (const auto& p : points) {
    EXPECT_NEAR(p.capacitance->value, capacitance, 1e-4 * capacitance);
    EXPECT_NEAR(p.tan_delta->value, 0, 1e-4);
    EXPECT_NEAR(p.phase->value, 0, 0.01);
    EXPECT_NEAR(p.amplitude, 2e4 / std::hypot(1, omega * 2e-3), 20);
  }
}

TEST(SmallSignal, AgainstThePoledDirectionThePhaseIsHalfATurn) {
  auto r = played(capacitor(), staircase(6), fine);
  for (double& x : *r.channels[static_cast<std::size_t>(Channel::displacement)]) x = -x;
  for (const auto& p : find_small_signal(r)) EXPECT_NEAR(p.phase->value, 180, 0.01);
}

TEST(SmallSignal, WhatWasNotMeasuredIsNotAskedFor) {
  auto r = played(capacitor(), staircase(6), fine);
  const auto without = [&](Channel channel) {
    auto less = r;
    less.channels[static_cast<std::size_t>(channel)].reset();
    return less;
  };
  const auto no_charge = recordings::small_signal_table(without(Channel::charge)),
             no_displacement = recordings::small_signal_table(without(Channel::displacement));
  ASSERT_TRUE(no_charge && no_displacement);
  for (const auto& column : no_charge->columns) EXPECT_NE(column.key, "capacitance_F");
  for (const auto& column : no_displacement->columns) EXPECT_NE(column.key, "d33_m_per_V");
  EXPECT_EQ(find_small_signal(without(Channel::field)).size(), 3U) << "as commanded";
  r.channels[static_cast<std::size_t>(Channel::charge)].reset();
  r.channels[static_cast<std::size_t>(Channel::displacement)].reset();
  EXPECT_FALSE(recordings::small_signal_table(r));
}

TEST(SmallSignal, SinesOfOtherProgramsAndBrokenOffOnesAreNone) {
  auto r = played(capacitor(), staircase(6), fine);
  auto cut = r;
  cut.segments.back().end_sample -= 200;
  EXPECT_EQ(find_small_signal(cut).size(), 2U);
  r.header.protocol["segments"] = {
      {{"kind", "sine"}, {"amplitude", 0.02}, {"frequency", frequency}, {"cycles", 6}}};
  EXPECT_TRUE(find_small_signal(r).empty());
  for (const auto* text : {"null", "3", R"({"small_signal": 1})"}) {
    r.header.protocol = nlohmann::json::parse(text);
    EXPECT_TRUE(find_small_signal(r).empty());
  }
}

TEST(SmallSignal, ItsCyclesAreNoLoops) {
  auto json = staircase(6);
  json["segments"].push_back({{"kind", "small_signal"},
                              {"levels", {-0.5, 0}},
                              {"rate", 2},
                              {"settle", 0.2},
                              {"amplitude", 0.02},
                              {"frequency", frequency}});
  const auto r = played(capacitor(), json, fine);
  const auto turns = recordings::turning_points(r);
  EXPECT_EQ(turns.points.size(), 6U);  // 0, 0.5, -0.5, 0, -0.5, 0
  for (const auto& cycle : find_cycles(r, turns)) EXPECT_NEAR(cycle.rate, 2e6, 1);
}

TEST(SmallSignal, AReportHasItsTableAndPictures) {
  const auto r = played(capacitor(), staircase(6), fine);
  const auto json =
      nlohmann::json::parse(render(recordings::make_report(r), recordings::Format::json))["small_signal"];
  ASSERT_EQ(json["rows"].size(), 3U);
  EXPECT_NEAR(json["rows"][1]["capacitance_F"].get<double>(), capacitance, 1e-4 * capacitance);
  EXPECT_EQ(json["rows"][1]["approached"], "down");
  std::vector<std::string> titles;
  for (const auto& figure : recordings::make_figures(r)) titles.push_back(figure.title);
  for (const auto* title :
       {"Relative permittivity against bias", "Loss against bias", "Piezoelectric coefficient against bias",
        "Phase of the displacement against bias"})
    EXPECT_THAT(titles, ::testing::Contains(title));
}

TEST(SmallSignal, APictureWantsTwoBiases) {
  auto json = staircase(6);
  json["segments"][0]["levels"] = {0, 0};
  auto r = played(capacitor(), json, fine);
  for (const auto& figure : recordings::make_figures(r)) EXPECT_FALSE(figure.title.ends_with("bias"));
  json["segments"][0]["levels"] = {0, 0.5, 0.5, 0};
  r = played(capacitor(), json, fine);
  int pictures = 0;
  for (const auto& figure : recordings::make_figures(r)) {
    if (!figure.title.ends_with("bias")) continue;
    ++pictures;
    ASSERT_EQ(figure.series.size(), 2U);
    EXPECT_EQ(figure.series[0].points[1][0], 0) << "from where it did not move";
    EXPECT_EQ(figure.series[1].points[1][0], 0.5) << "from where the other turned";
  }
  EXPECT_EQ(pictures, 4);
}

TEST(SmallSignal, SlowSamplingIsRefused) {
  const protocols::SampledWaveform slow(protocols::Protocol::from_json(staircase(6)).expand(), 190);
  const auto problems = check(slow, {});
  ASSERT_EQ(problems.size(), 1U);
  EXPECT_EQ(problems[0].path, "/segments/0/frequency");
  EXPECT_EQ(problems[0].allowed["from"], 200);
  const protocols::SampledWaveform enough(protocols::Protocol::from_json(staircase(6)).expand(), 200);
  EXPECT_TRUE(check(enough, {}).empty());
}

void take(Coverage& coverage, const std::optional<Estimate>& estimate, double truth) {
  ASSERT_TRUE(estimate);
  coverage.take((estimate->value - truth) / estimate->uncertainty());
}

void expect_coverage(bool coloured) {
  constexpr int runs = 200;
  constexpr double tau = 0.005;
  const auto model = capacitor(effect("displacement_lag", "time_constant", tau));
  // How samples go together is told from windows of 96: fewer than a hundred of them leave more beyond.
  const auto exact = played(model, staircase(coloured ? 40 : 10), 100 * frequency);
  const auto sensors = sensors_of({}, model);
  // The lag follows the lines between samples, not the sine: what it makes of these, without noise.
  const auto truth = find_small_signal(exact);
  std::array<Coverage, 5> counts;
  for (std::uint64_t seed = 1; seed <= runs; ++seed) {
    auto r = exact;
    r.noise.fill(std::nullopt);
    std::uint64_t number = 0;
    for (const auto channel : {Channel::field, Channel::charge, Channel::displacement}) {
      auto sensor = sensors[static_cast<std::size_t>(channel)];
      auto& values = *r.channels[static_cast<std::size_t>(channel)];
      if (coloured) add_coloured(10 * seed + ++number, std::exchange(sensor.noise, 0), values);
      const Converter converter(channel, sensor, seed);
      std::vector<std::int16_t> raw(values.size());
      converter.convert(0, values, raw.data(), 1);
      for (std::size_t i = 0; i < values.size(); ++i) values[i] = converter.column().gain * raw[i];
    }
    const auto points = find_small_signal(r);
    ASSERT_EQ(points.size(), truth.size());
    for (std::size_t k = 0; k < points.size(); ++k) {
      take(counts[0], points[k].capacitance, capacitance);
      take(counts[1], points[k].permittivity, permittivity / vacuum_permittivity);
      take(counts[2], points[k].tan_delta, 0);
      take(counts[3], points[k].d33, truth[k].d33->value);
      take(counts[4], points[k].phase, truth[k].phase->value);
    }
  }
  for (const auto& count : counts) {
    // Binomial: 95.4 % of 600, whose standard deviation is 0.85 %, within three and a half of them.
    EXPECT_EQ(count.figures, 3 * runs);
    std::cout << count.percent() << " % within 2 u, errors of " << count.rms() << " u\n";
    EXPECT_GE(count.percent(), 92.4);
    EXPECT_LE(count.percent(), 98.4);
    EXPECT_NEAR(count.rms(), 1, 0.12);
  }
}

TEST(SmallSignal, UncertaintiesCoverTheTruth) {
  expect_coverage(false);
}

TEST(SmallSignal, AndWhereNeighboursGoTogether) {
  expect_coverage(true);
}

}  // namespace
}  // namespace ferrobench::daq

// What effects leave, and what stands for it: tables beside named effects, on a linear actuator whose
// hysteresis has no name in the catalogue.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <numbers>
#include <random>
#include <sstream>

#include "model/inference/parameters/parameters.h"
#include "model/inference/report/discovery_report.h"
#include "model/inference/study/discover.h"
#include "model/inference/study/empirical_term.h"
#include "model/inference/study/sensor_channel.h"
#include "model/model.h"
#include "model/on_recording.h"

namespace ferrobench::model {
namespace {

using recordings::Channel;
using testing::Contains;
using testing::Not;

// A stage under a sinusoidal voltage; nothing but displacement against the measured field.
recordings::Recording stage(std::vector<double> time, std::vector<double> field,
                            std::vector<double> displacement) {
  recordings::Recording r;
  r.header.title = "stage";
  r.header.specimen = {"stage", 0.02, 25e-6, 1e-4, 200};
  r.time = std::move(time);
  r.set(Channel::field) = std::move(field);
  r.set(Channel::displacement) = std::move(displacement);
  return r;
}

// Linear in the field, seen late, with backlash of two widths: more of its loop is the delay's.
recordings::Recording with_backlash(double begin, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> noise(0, 2e-8);
  constexpr double frequency = 1, amplitude = 1.5e6, delay = 0.012;
  std::vector<double> time, field, displacement;
  std::array<double, 2> play{};
  for (int i = -2000; i < 2000; ++i) {  // a period to settle in, and one that is recorded
    const double t = begin + i / (2000 * frequency);
    const auto field_at = [&](double at) {
      return amplitude * std::sin(2 * std::numbers::pi * frequency * at);
    };
    const double e = field_at(t - delay);
    constexpr std::array radius{0.2e6, 0.9e6};
    for (std::size_t j = 0; j < play.size(); ++j) play[j] = std::clamp(play[j], e - radius[j], e + radius[j]);
    if (i < 0) continue;
    time.push_back(t);
    field.push_back(field_at(t));
    displacement.push_back(0.02 * (5e-10 * e + 3e-11 * play[0] + 8e-11 * play[1]) + noise(random));
  }
  return stage(std::move(time), std::move(field), std::move(displacement));
}

std::vector<NamedRecording> real_stage() {
  std::ifstream file(std::filesystem::path(FERROBENCH_SOURCE).parent_path() / "shared" / "data" / "measured" /
                     "stage_hysteresis_1hz_7s_9s.csv");
  std::array<std::vector<double>, 3> columns;  // s, um, V
  std::string line;
  while (std::getline(file, line)) {
    std::replace(line.begin(), line.end(), ',', ' ');
    std::istringstream row(line);
    for (auto& c : columns) row >> c.emplace_back();
  }
  for (double& x : columns[1]) x *= 1e-6;
  for (double& v : columns[2]) v /= 1e-4;
  const auto part = [&](std::ptrdiff_t from, std::ptrdiff_t to) {
    const auto of = [&](const std::vector<double>& c) {
      return std::vector<double>(c.begin() + from, c.begin() + to);
    };
    return stage(of(columns[0]), of(columns[2]), of(columns[1]));
  };
  const auto rows = std::ssize(columns[0]);
  if (rows == 0) return {};
  return {{"first", part(0, rows / 2)}, {"second", part(rows / 2, rows)}};
}

// Rms over the range that a model leaves of a recording, the displacement's zero apart.
double miss_of(const Model& model, const recordings::Recording& r) {
  const auto t = simulate_on(model, r);
  const auto& measured = r.at(Channel::displacement);
  double sum = 0, squares = 0;
  for (std::size_t i = 0; i < measured.size(); ++i) {
    const double d = t.displacement[i] - measured[i];
    sum += d;
    squares += d * d;
  }
  const double n = static_cast<double>(measured.size());
  const auto [low, high] = std::ranges::minmax(measured);
  return std::sqrt(squares / n - std::pow(sum / n, 2)) / (high - low);
}

std::size_t tables_in(const Discovery& d) {
  return static_cast<std::size_t>(std::ranges::count_if(d.added, &AddedTerm::empirical));
}

// Far from what the model can do, and a simulation that fails while that is narrowed.
TEST(Improvement, WhatWasFoundStandsWhereASimulationFails) {
  bool failed = false;
  const auto d = discover(library_model("linear-capacitor"),
                          {{"first", with_backlash(0.3, 1)}, {"second", with_backlash(1.4, 2)}},
                          {.held_out = {"second"}, .progress = [&](const DiscoverProgress& p) {
                             failed = failed || p.stage == "how wrong the model is";
                             if (p.stage == "how wrong the model is")
                               throw Error(ErrorCode::numerical, "the model cannot be solved");
                             return true;
                           }});
  EXPECT_TRUE(failed);
  EXPECT_EQ(d.verdict, Verdict::unknown);
  EXPECT_TRUE(d.added.empty());
  EXPECT_THAT(d.health.warnings, Contains(testing::HasSubstr("not narrowed: the model cannot be solved")));
}

TEST(Improvement, WhatANamedEffectLeavesIsNarrowedByATable) {
  const auto d = discover(library_model("linear-capacitor"),
                          {{"first", with_backlash(0.3, 1)}, {"second", with_backlash(1.4, 2)}},
                          {.held_out = {"second"}});
  ASSERT_TRUE(d.verdict == Verdict::named || d.verdict == Verdict::ambiguous);
  EXPECT_FALSE(d.added.front().empirical);
  EXPECT_EQ(tables_in(d), 1);
  EXPECT_EQ(d.improved.effects.size(), d.added.size());
  // One number for each parameter, though both the name and the table were estimated.
  for (const auto& a : d.added) EXPECT_EQ(a.term.parameters.size(), find_effect(a.term.id).parameters.size());
  EXPECT_LT(d.left.at(Channel::displacement).model_error, 0.002);
  EXPECT_GT(d.share_held_out, 0.99);
}

// A strain that pushes against nothing is linear in the weights of its table, so what the linearized term
// promises is what the fit gets; only the width is not looked for further.
TEST(EmpiricalTerm, PromisesWhatItsFitGets) {
  using namespace inference;
  const auto model = library_model("linear-capacitor");
  std::vector<std::string> warnings;
  const auto bench = prepare_bench(model, {{"first", with_backlash(0.3, 1)}}, 40000, warnings);
  const auto noise = estimate_noise(bench, warnings);
  const WhitenedRecordings residuals(bench, noise, {0}, {}, 2);
  const auto base = base_hypothesis(model, bench);
  const auto without = minimize(residuals, base, prior_mean(base), {.tick = {}});
  const LogLikelihoodRatio likelihood = [&](const Fit& with) { return without.squares - with.squares; };
  const auto field = 1.5e6, strain = 1e-5;
  const auto linearized =
      linearize_term(find_effect("empirical_strain"), residuals, without, {strain, field}, likelihood);
  ASSERT_EQ(linearized.fixed.size(), 3);  // and the time constant, of the recording's own times
  EXPECT_GT(linearized.fixed.back(), 1e-3);
  EXPECT_LT(linearized.fixed.back(), 1);
  const auto fitted = fit_empirical(residuals, without, linearized, likelihood, {.tick = {}});
  EXPECT_LT(fitted.fit.squares, 0.01 * without.squares);
  EXPECT_NEAR(linearized.evidence, fitted.evidence, 1e-3 * fitted.evidence);
}

// A charge with a backlash that the model lacks, and a displacement that is the model's but for a small one.
// It is seen late, which shows in proportion to the frequency.
recordings::Recording with_two_sensors(double frequency, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> unit;
  constexpr double amplitude = 1.5e6, delay = 4e-3, play = 0.6e6;
  constexpr int rows = 1500;
  std::vector<double> time, field, displacement, charge;
  double lagging = 0;
  for (int i = -rows; i < 2 * rows; ++i) {
    const double t = i / (rows * frequency);
    const auto field_at = [&](double at) {
      return amplitude * std::sin(2 * std::numbers::pi * frequency * at);
    };
    lagging = std::clamp(lagging, field_at(t) - play, field_at(t) + play);
    if (i < 0) continue;
    time.push_back(t);
    field.push_back(field_at(t));
    charge.push_back(200 * 25e-6 * (2e-8 * field_at(t) + 4e-9 * lagging) + 1e-8 * unit(random));
    displacement.push_back(0.02 * (5e-10 * field_at(t - delay) + 1e-11 * lagging) + 1e-8 * unit(random));
  }
  auto out = stage(std::move(time), std::move(field), std::move(displacement));
  out.set(Channel::charge) = std::move(charge);
  return out;
}

const std::vector<std::string> what_could_be_late{"displacement_delay", "displacement_nonlinearity",
                                                  "logarithmic_creep", "source_resistance"};

// What is wrong with the charge says nothing about the displacement's sensor.
TEST(Improvement, ASensorsEffectIsJudgedByItsOwnChannel) {
  const auto d = discover(library_model("linear-capacitor"),
                          {{"slow", with_two_sensors(1, 1)},
                           {"fast", with_two_sensors(20, 2)},
                           {"locked", with_two_sensors(15, 3)}},
                          {.held_out = {"locked"}, .candidates = what_could_be_late});
  ASSERT_EQ(d.verdict, Verdict::named) << text_report(d);
  ASSERT_FALSE(d.added.empty());
  const auto& found = d.added.front();
  ASSERT_EQ(found.term.id, "displacement_delay");
  EXPECT_NEAR(found.term.parameters.front().value, 4e-3, 2e-4);
  EXPECT_EQ(found.channel, Channel::displacement);
  EXPECT_GT(found.share.value_or(0), 0.9);
  EXPECT_GT(found.share_held_out.value_or(0), 0.9);
  EXPECT_THAT(text_report(d), testing::HasSubstr("of the excess of the displacement that stood before it"));
  EXPECT_EQ(to_json(d)["added"][0]["share_of"], "displacement");
  EXPECT_THAT(text_report(d), testing::HasSubstr("Of no effect is it known how small it would have shown"));
}

// A slow recording can neither confirm nor refute what is late by a few milliseconds.
TEST(Improvement, ARecordingThatCannotShowASensorsEffectSaysNothingOfIt) {
  const auto d = discover(library_model("linear-capacitor"),
                          {{"fast", with_two_sensors(20, 1)},
                           {"faster", with_two_sensors(25, 2)},
                           {"locked", with_two_sensors(0.02, 3)}},
                          {.held_out = {"locked"}, .candidates = what_could_be_late});
  ASSERT_EQ(d.verdict, Verdict::named) << text_report(d);
  ASSERT_FALSE(d.added.empty());
  EXPECT_EQ(d.added.front().term.id, "displacement_delay");
  EXPECT_GT(d.added.front().share.value_or(0), 0.9);
  EXPECT_FALSE(d.added.front().share_held_out) << *d.added.front().share_held_out;
}

// What an effect takes of the displacement is a sensor's only if the force, in proportion, does not show the
// same.
TEST(SensorChannel, WhatForceShowsAsWellIsOfTheMotion) {
  using namespace inference;
  std::vector<BenchRecording> bench(2);
  for (auto& r : bench) r.channels.emplace_back().range = 2e-5;  // of the displacement
  bench[0].channels.emplace_back().channel = Channel::force;
  bench[0].channels.back().range = 50;
  const NoiseModel of_displacement{.white = 2e-8}, of_force{.white = 0.1};
  const std::vector<std::vector<NoiseModel>> noise{{of_displacement, of_force}, {of_displacement}};
  const double gap = std::nan("");
  const Signals before{{{30, -20, gap, 10}, {3, 2, 1, 4}}, {{1, 2, 3, 4}}};
  Signals after{{{0, 0, gap, 0}, {3, 2, 1, 4}}, {{0, 0, 0, 0}}};
  const std::vector<std::size_t> both{0, 1}, second{1};
  const Misses misses{bench, noise, both, before, after};
  EXPECT_DOUBLE_EQ(squares_of_change(misses, Channel::displacement), 1400 + 30);
  EXPECT_DOUBLE_EQ(excess_taken(misses, Channel::displacement).before, 1400 - 3 + 30 - 4);
  EXPECT_DOUBLE_EQ(excess_taken(misses, Channel::displacement).share(), 1);
  EXPECT_FALSE(is_of_the_motion(misses, Channel::displacement));
  after[0][1] = {15, -10, 0, 5};  // 0.1 N of 50 N is twice 2e-8 m of 2e-5 m
  EXPECT_TRUE(is_of_the_motion(misses, Channel::displacement));
  EXPECT_FALSE(is_of_the_motion(misses, Channel::charge));
  EXPECT_FALSE(is_of_the_motion({bench, noise, second, {before[1]}, {after[1]}}, Channel::displacement));
}

TEST(Improvement, WithoutACommandNothingIsSaidOfTheAmplifier) {
  const auto d = discover(library_model("linear-capacitor"),
                          {{"first", with_backlash(0.3, 1)}, {"second", with_backlash(1.4, 2)}},
                          {.held_out = {"second"}, .candidates = {"amplifier_lag", "displacement_lag"}});
  EXPECT_THAT(d.not_testable, Contains("amplifier_lag"));
  for (const auto& e : d.explanations)
    for (const auto& effect : e.effects) EXPECT_NE(effect.id, "amplifier_lag");
  for (const auto& a : d.added) EXPECT_NE(a.term.id, "empirical_drive");
}

// Rms over the range; a sparse regression that was published for these rows leaves 0.236 %.
TEST(Improvement, ARealStageIsMetByOneTable) {
  auto recordings = real_stage();
  if (recordings.empty()) GTEST_SKIP() << "the measured file is not here";
  const auto locked = recordings[1].recording;
  const auto d = discover(library_model("linear-capacitor"), std::move(recordings), {.held_out = {"second"}});
  EXPECT_LE(tables_in(d), 1);
  EXPECT_LT(d.left.at(Channel::displacement).of_range, 0.003);
  // The model alone predicts as well, without what was learned of the instrument.
  EXPECT_LT(miss_of(d.improved, locked), 0.003);
}

TEST(DiscoveryReport, SaysWhatWasAskedAndWhatMovedBeyondWhatWasKnown) {
  Discovery d;
  d.asked.model.name = "my stage";
  d.asked.sources = {{"loop-1", "slow loop", "5f0c", "2026-01-02T03:04:05Z"}};
  d.recalibrated["gain.charge"] = {1, 1.15, 0.001, 4.7};
  d.recalibrated["gain.force"] = {1, 1.02, 0.001, 0.7};
  for (const auto& report : {text_report(d), html_report(d)}) {
    EXPECT_THAT(report, testing::HasSubstr("my stage"));
    EXPECT_THAT(report, testing::HasSubstr("loop-1: slow loop, 2026-01-02T03:04:05Z, 5f0c"));
    EXPECT_THAT(report, testing::HasSubstr("gain.charge went from 1 to 1.15, 4.7 standard deviations"));
    EXPECT_THAT(report, Not(testing::HasSubstr("gain.force went")));
  }
  const auto json = to_json(d);
  EXPECT_EQ(json["asked"]["sources"][0]["identifier"], "5f0c");
  EXPECT_EQ(json["recalibrated"]["gain.charge"]["over_prior"], 4.7);
}

TEST(LinearCapacitor, HasNothingOfSwitchingToFit) {
  std::vector<std::string> free;
  for (const auto& p : default_free_parameters(library_model("linear-capacitor"))) free.push_back(p.path);
  EXPECT_THAT(free, testing::UnorderedElementsAre("material.permittivity_180", "material.compliance_180",
                                                  "material.piezoelectric_180"));
  EXPECT_FALSE(is_held(library_model("soft-pzt"), "material.barrier"));
  auto at_the_end = library_model("soft-pzt");
  at_the_end.material.barrier = 1.2 * free_parameter(at_the_end, "material.barrier").high;
  EXPECT_FALSE(is_held(at_the_end, "material.barrier"));
}

}  // namespace
}  // namespace ferrobench::model

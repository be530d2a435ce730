// Whitened residuals of recordings: the noise that they are counted in, their exact slopes against
// differences of the residuals themselves, and which of them are drawn.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <numbers>
#include <random>

#include "model/inference/residuals/whitened_recordings.h"
#include "model/inference/study/validation.h"
#include "model/simulator.h"

namespace ferrobench::model::inference {
namespace {

using recordings::Channel;

Model sprung() {
  auto m = library_model("soft-pzt");
  m.effects.clear();
  m.load.prestress = 8e6;
  return m;
}

// A loop with a hold.
double command_at(double t) {
  return t < 2 ? -0.9e6 * t : t < 5 ? -1.8e6 + 1.2e6 * (t - 2) : t < 6 ? 1.8e6 : 1.8e6 - 9e5 * (t - 6);
}

// The loop with noise; without a command the drive is read from the measured field.
recordings::Recording record(const Model& m, bool with_command, protocols::PastKind past) {
  std::mt19937_64 random(4);
  std::normal_distribution<double> normal;
  recordings::Recording r;
  std::vector<double> command;
  for (int i = 0; i <= 800; ++i) {
    const double t = 0.01 * i;
    r.time.push_back(t);
    command.push_back(command_at(t));
  }
  r.header.past = {past};
  const auto t =
      simulate(m, r.time, command, {.tolerance = 1e-5, .domains = 1000, .shift = 3, .past = &r.header.past});
  r.header.specimen = {m.name, m.actuator.length, m.actuator.area, m.actuator.layer_thickness,
                       m.actuator.layer_count};
  r.header.load = {m.load.spring_stiffness, m.load.prestress};
  if (with_command) r.set(Channel::command) = command;
  const auto put = [&](Channel channel, std::vector<double> values, double noise) {
    for (double& v : values) v += noise * normal(random);
    r.set(channel) = std::move(values);
  };
  put(Channel::field, t.field, 5e3);
  put(Channel::charge, t.charge, 3e-6);
  put(Channel::displacement, t.displacement, 5e-8);
  put(Channel::force, t.force, 0.15);
  return r;
}

struct Residuals {
  explicit Residuals(bool with_command, protocols::PastKind past = protocols::PastKind::poled_plus,
                     std::atomic<std::uint64_t>* begun = nullptr)
      : bench(prepare_bench(sprung(), {{"loop", record(sprung(), with_command, past)}}, 2000, warnings)),
        noise(estimate_noise(bench, warnings)),
        of(bench, noise, {0}, {.tolerance = 1e-6, .domains = 1000, .begun = begun}, 2) {}
  std::vector<std::string> warnings;
  std::vector<BenchRecording> bench;
  std::vector<std::vector<NoiseModel>> noise;
  WhitenedRecordings of;
};

// The displacement under a command, with this noise, poled before.
recordings::Recording displaced(std::vector<double> time, std::vector<double> command,
                                const std::function<double()>& noise) {
  const auto m = sprung();
  recordings::Recording r;
  r.header.past = {protocols::PastKind::poled_plus};
  auto t = simulate(m, time, command, {.tolerance = 1e-4, .domains = 250, .past = &r.header.past});
  r.header.specimen = {m.name, m.actuator.length, m.actuator.area, m.actuator.layer_thickness,
                       m.actuator.layer_count};
  r.header.load = {m.load.spring_stiffness, m.load.prestress};
  r.time = std::move(time);
  r.set(Channel::command) = std::move(command);
  for (double& v : t.displacement) v += noise();
  r.set(Channel::displacement) = std::move(t.displacement);
  return r;
}

// Every thirtieth sample of a noise with a memory of six looks white; its level is that of all samples.
TEST(EstimateNoise, OfThinnedRowsIsThatOfTheSamples) {
  constexpr double interval = 1.4e-4, rows = 6, share = 0.8, level = 5e-8;
  constexpr int samples = 57000;
  std::vector<double> time, command;
  for (int i = 0; i < samples; ++i) {
    time.push_back(interval * i);
    command.push_back(command_at(time.back()));
  }
  std::mt19937_64 random(11);
  std::normal_distribution<double> normal;
  const double kept = std::exp(-1 / rows);
  double slow = normal(random);
  const auto noise_of_sample = [&] {
    slow = kept * slow + std::sqrt(1 - kept * kept) * normal(random);
    return level * (std::sqrt(share) * slow + std::sqrt(1 - share) * normal(random));
  };
  std::vector<std::string> warnings;
  const auto bench = prepare_bench(
      sprung(), {{"loop", displaced(std::move(time), std::move(command), noise_of_sample)}}, 1900, warnings);
  ASSERT_LT(bench[0].time.size(), samples / 20);
  const auto noise = estimate_noise(bench, warnings);
  // As of recordings that are not thinned (NoiseColour).
  EXPECT_NEAR(noise[0][0].std() / level, 1, 0.25);
  EXPECT_NEAR(noise[0][0].correlation_time / (rows * interval), 1, 0.5);
}

// Loops of 80 rows a leg: no 96 rows of them are quiet, and what a quartic leaves is signal.
TEST(EstimateNoise, OfLoopsThatWereSampledSeldomIsWhite) {
  constexpr double level = 1e-7;
  std::vector<double> time, command;
  for (int i = 0; i < 4800; ++i) {
    time.push_back(5e-3 * i);
    command.push_back(2e6 * std::sin(2 * std::numbers::pi * i / 160));
  }
  std::mt19937_64 random(5);
  std::normal_distribution<double> normal;
  std::vector<std::string> warnings;
  const auto bench = prepare_bench(
      sprung(),
      {{"loops", displaced(std::move(time), std::move(command), [&] { return level * normal(random); })}},
      6000, warnings);
  const auto noise = estimate_noise(bench, warnings);
  EXPECT_EQ(noise[0][0].slow, 0);
  EXPECT_NEAR(noise[0][0].std() / level, 1, 0.25);
  EXPECT_THAT(warnings, testing::Contains(testing::HasSubstr("signal of the displacement")));
}

// Where an answer adds nothing, its pictures are of what is missed most, not of what comes first.
TEST(Traces, AreOfWhatIsMissedMostWhereNothingIsGained) {
  const Residuals r(true);
  const auto& channels = r.bench[0].channels;
  Prediction same;
  same.simulated.resize(1);
  same.standardized.resize(1);
  for (std::size_t c = 0; c < channels.size(); ++c) {
    same.simulated[0].push_back(channels[c].value);
    same.standardized[0].emplace_back(r.bench[0].time.size(), 0.1 * static_cast<double>(1 + c));
  }
  const auto shown = traces(r.of, same, same, 1, false);
  ASSERT_EQ(shown.size(), 1u);
  EXPECT_EQ(shown[0].channel, channels.back().channel);
}

// Two programs of which one is everywhere 2.5e-5 of the range above the other.
TEST(SquaresBetweenPrograms, AreThoseOfAShareOfTheRange) {
  const Residuals r(true);
  double squares = 0;
  for (std::size_t c = 0; c < r.bench[0].channels.size(); ++c) {
    auto white = r.noise[0][c];
    white.white = white.std();
    white.slow = 0;
    std::vector<double> apart(r.bench[0].time.size(), 2.5e-5 * r.bench[0].channels[c].range);
    Whitening(white, r.bench[0].time).apply(apart);
    for (const double v : apart) squares += v * v;
  }
  const std::vector<std::size_t> first{0};
  EXPECT_NEAR(squares_between_programs(r.bench, r.noise, first), squares, 1e-9 * squares);
  EXPECT_EQ(squares_between_programs(r.bench, r.noise, {}), 0);
}

// Of every parameter that a hypothesis may move: numbers of the model, an effect, spring, prestress, gains,
// and the drive's own where it was measured. What differences of 1 % of a prior's width make of the
// simulation's own steps is up to 2 % of a slope.
class SlopesOfResiduals : public testing::TestWithParam<std::tuple<bool, protocols::PastKind>> {};

TEST_P(SlopesOfResiduals, AreTheirDerivatives) {
  const auto [with_command, past] = GetParam();
  Residuals residuals(with_command, past);
  const auto hypothesis =
      with_effect(base_hypothesis(sprung(), residuals.bench), find_effect("source_resistance"), {4000});
  auto z = prior_mean(hypothesis);
  for (Eigen::Index i = 0; i < z.size(); ++i) z[i] = 0.2 * static_cast<double>((i * 7) % 5 - 2);
  if (!with_command) residuals.of.marginalize_drive(hypothesis, z);
  const auto slopes = residuals.of.slopes(hypothesis, z);
  ASSERT_TRUE(slopes);
  ASSERT_EQ(slopes->cols(), z.size());
  for (Eigen::Index i = 0; i < z.size(); ++i) {
    auto up = z, down = z;
    up[i] += 0.01;
    down[i] -= 0.01;
    const Eigen::VectorXd difference =
        (residuals.of.evaluate(hypothesis, up) - residuals.of.evaluate(hypothesis, down)) / 0.02;
    EXPECT_LT((slopes->col(i) - difference).norm(), 0.02 * difference.norm() + 1)
        << hypothesis.parameters[static_cast<std::size_t>(i)].path << ", norm " << difference.norm();
  }
  // Those from a parameter on are the same.
  const auto last = residuals.of.slopes(hypothesis, z, z.size() - 2);
  ASSERT_TRUE(last);
  EXPECT_LT((*last - slopes->rightCols(2)).norm(), 1e-9 * slopes->rightCols(2).norm());
}

INSTANTIATE_TEST_SUITE_P(DrivesAndPasts, SlopesOfResiduals,
                         testing::Combine(testing::Bool(),
                                          testing::Values(protocols::PastKind::poled_plus,
                                                          protocols::PastKind::poled_minus)));

TEST(SlopesOfResiduals, AreNotHadWhereTheModelCannotBeSolved) {
  Residuals residuals(true);
  const auto hypothesis = base_hypothesis(sprung(), residuals.bench);
  residuals.of.simulate_by({.tolerance = 1e-6, .domains = 1000, .most_steps = 3});
  EXPECT_FALSE(residuals.of.slopes(hypothesis, prior_mean(hypothesis)));
}

// Those that differ in sensors and gains share a simulation, and others do not.
TEST(Residuals, AtSeveralPlacesAreThoseAtEach) {
  std::atomic<std::uint64_t> begun = 0;
  const Residuals residuals(true, protocols::PastKind::poled_plus, &begun);
  const auto base = base_hypothesis(sprung(), residuals.bench);
  const auto lag = with_effect(base, find_effect("displacement_lag"), {1e-3}),
             creep = with_effect(base, find_effect("load_cell_creep"), {0.01, 0.1}),
             slow = with_effect(base, find_effect("amplifier_lag"), {1e-3});
  auto louder = prior_mean(base);
  louder.tail(1).array() += 1;
  ASSERT_TRUE(base.parameters.back().path.starts_with("gain."));
  const std::vector<std::pair<const Hypothesis*, Eigen::VectorXd>> places{{&base, prior_mean(base)},
                                                                          {&slow, prior_mean(slow)},
                                                                          {&lag, prior_mean(lag)},
                                                                          {&base, louder},
                                                                          {&creep, prior_mean(creep)}};
  const auto together = residuals.of.evaluate(places);
  EXPECT_EQ(begun, 2 * residuals.bench.size());
  for (std::size_t i = 0; i < places.size(); ++i)
    EXPECT_EQ(together[i], residuals.of.evaluate(*places[i].first, places[i].second)) << i;
}

}  // namespace
}  // namespace ferrobench::model::inference

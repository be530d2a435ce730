// Another base physics: off it is the twin as it was, and each kind does what it is said to do.
#include "tests/campaign/other_physics.h"

#include <gtest/gtest.h>

#include "model/on_recording.h"
#include "tests/campaign/bench.h"
#include "tests/campaign/grains.h"
#include "tests/campaign/recalibration.h"
#include "tests/model/effects_support.h"

namespace ferrobench::campaign {
namespace {

using model::apart;
using recordings::Channel;

// One bipolar loop from and to rest.
const model::Program loop{{{0, 0}, {0.1, -2e6}, {0.3, 2e6}, {0.4, 0}}, 2e-3};

Response played(const std::vector<model::EffectSetting>& physics, double spring = 3e6) {
  auto base = model::library_model("soft-pzt");
  base.load = {.spring_stiffness = spring, .prestress = 5e6};
  return play(base, physics, loop.time, loop.field, {.domains = 1024});
}

model::EffectSetting with_first(const Outsider& kind, double first) {
  model::EffectSetting out{.id = std::string(kind.id), .parameters = {}};
  for (const auto& p : kind.parameters) out.parameters.emplace_back(p.name, std::sqrt(p.low * p.high));
  out.parameters.front().second = first;
  return out;
}

TEST(OtherPhysics, OffIsTheTwinBitForBit) {
  const auto plain = played({});
  for (const auto& kind : other_physics()) {
    const auto off = played({with_first(kind, 0)});
    EXPECT_EQ(off.charge, plain.charge) << kind.id;
    EXPECT_EQ(off.displacement, plain.displacement) << kind.id;
    EXPECT_EQ(off.force, plain.force) << kind.id;
  }
}

// The more general equations lead to the plain ones.
TEST(OtherPhysics, NextToNothingOfItIsTheTwin) {
  const auto plain = played({});
  for (const auto& kind : other_physics()) {
    const auto faint = played({with_first(kind, 1e-9)});
    EXPECT_LT(apart(plain.charge, faint.charge), 1e-5) << kind.id;
    EXPECT_LT(apart(plain.displacement, faint.displacement), 1e-5) << kind.id;
  }
}

// Barriers decide how fast the wells are filled, not how far.
TEST(OtherPhysics, KeepsTheEquilibrium) {
  const RateLaw plain{.polarization = 0.3,
                      .strain_90 = -0.003,
                      .piezoelectric = 5e-10,
                      .inverse_energy = 5e-4,
                      .attempt_rate = 1e3};
  const Nodes node{{4e4}, {0}, {0}, {1}, {}};
  const LoadPoint load{.field = -3e3, .stress = -2e5};
  const auto settled = [&](const RateLaw& law) {
    Grains grains(node);
    return advance(law, grains, 1e15, load, load);
  };
  const auto expected = settled(plain);
  EXPECT_NEAR(expected.minus / expected.plus, std::exp(5e-4 * 2 * 3e3 * (0.3 - 5e-10 * 2e5)), 1e-9);
  for (const double exponent : {1.85, 2.15})
    for (const double direct : {0.0, 0.1}) {
      auto law = plain;
      law.exponent = exponent;
      law.direct_rate = direct;
      EXPECT_NEAR(settled(law).plus, expected.plus, 1e-9) << exponent << ' ' << direct;
      EXPECT_NEAR(settled(law).minus, expected.minus, 1e-9) << exponent << ' ' << direct;
    }
}

TEST(OtherPhysics, DirectSwitchingMovesChargeWithoutStrain) {
  const auto plain = played({}),
             direct = played({{"direct_180_switching", {{"rate_ratio", 10}, {"barrier_ratio", 1.2}}}});
  const auto span = [](const std::vector<double>& v) { return std::ranges::max(v) - std::ranges::min(v); };
  EXPECT_NEAR(span(direct.charge) / span(plain.charge), 1, 0.03);
  EXPECT_GT(std::ranges::min(direct.displacement), 0.3 * std::ranges::min(plain.displacement));
}

TEST(OtherPhysics, SpringWithHysteresisLosesWork) {
  const auto work = [](const Response& r) {
    double sum = 0;
    for (std::size_t i = 0, last = r.force.size() - 1; i < r.force.size(); last = i++)
      sum += 0.5 * (r.force[i] + r.force[last]) * (r.displacement[i] - r.displacement[last]);
    return sum;  // once around, closed by a straight line
  };
  const auto range = [](const std::vector<double>& v) { return std::ranges::max(v) - std::ranges::min(v); };
  const auto plain = played({});
  const auto lossy = played({{"spring_hysteresis", {{"width", 1e-6}, {"distance", 1e-6}}}});
  EXPECT_NEAR(work(plain), 0, 1e-3 * range(plain.force) * range(plain.displacement));
  // Two swings and back, each with up to 2 k width of hysteresis.
  const double most = 3e6 * 1e-6 * 4 * range(lossy.displacement);
  EXPECT_GT(work(lossy), 0.3 * most);
  EXPECT_LT(work(lossy), most);
}

TEST(OtherPhysics, UnequalBarriersShiftTheLoop) {
  const auto middle = [](const Response& r) {
    double sum = 0;  // of the fields at which the charge goes through zero
    for (std::size_t i = 1; i < r.charge.size(); ++i)
      if ((r.charge[i] > 0) != (r.charge[i - 1] > 0)) sum += r.field[i];
    return sum / 2;
  };
  EXPECT_NEAR(middle(played({})), 0, 4e4);
  EXPECT_GT(middle(played({{"switching_asymmetry", {{"fraction", 0.2}}}})), 5e4);
}

TEST(OtherPhysics, TailsAreStudents) {
  const auto base = model::library_model("soft-pzt");
  const auto share_beyond = [&](double deviations, double inverse_freedom) {
    Terms terms;
    terms.inverse_freedom = inverse_freedom;
    const auto& p = base.polycrystal;
    const auto nodes = draw_nodes(base.material, p, 16384, terms);
    const auto far = [&](double e) {
      return std::abs(e - p.bias_field) > deviations * p.interaction_field_std;
    };
    return static_cast<double>(std::ranges::count_if(nodes.field, far)) / 16384;
  };
  EXPECT_NEAR(share_beyond(3, 0), 0.0026998, 2e-4);
  EXPECT_NEAR(share_beyond(3, 0.25), 0.0399420, 2e-3);  // of Student's t with 4 degrees of freedom
}

// At constant loads: the mean of exp(-s k) over the paces k is exp(-s^beta).
TEST(OtherPhysics, WaitingIsAStretchedExponential) {
  const auto base = model::library_model("soft-pzt");
  for (const double beta : {0.5, 0.8, 0.95}) {
    Terms terms;
    terms.stretching = beta;
    const auto nodes = draw_nodes(base.material, base.polycrystal, 16384, terms);
    for (const double s : {0.1, 1.0, 5.0}) {
      double mean = 0;
      for (const double pace : nodes.pace) mean += std::exp(-s * pace) / 16384;
      EXPECT_NEAR(mean, std::exp(-std::pow(s, beta)), 2e-3) << beta << ' ' << s;
    }
  }
}

TEST(OtherPhysics, CollidesWithEffectsThatThereAre) {
  int collisions = 0;
  for (const auto& kind : other_physics())
    for (const auto& effect : model::effect_catalogue()) collisions += !collision(kind.id, effect.id).empty();
  EXPECT_EQ(collisions, 6);
}

// What is a parameter of the base model is taken up, what is not is left.
TEST(Recalibration, TakesUpWhatAFitWould) {
  auto base = model::library_model("soft-pzt");
  base.polycrystal.bias_field = 4e4;
  base.load = {.spring_stiffness = 3e6, .prestress = 5e6};
  std::mt19937_64 random(1);
  auto programs = draw_programs(random, 2e6);
  programs = {programs[1]};  // fast loops
  const Sizing sizing(base, programs, {0, 1, 2, 3});
  auto noise = sizing.ranges();
  for (double& v : noise) v *= 2e-3;
  const Recalibration recalibration(sizing, noise);
  const model::EffectSetting bias{"internal_bias_field", {{"field", 6e3}}};
  const model::EffectSetting pickup{"mains_pickup", {{"amplitude", 1e-7}, {"frequency", 60}}};
  EXPECT_GT(sizing.size(bias, noise), 1);
  EXPECT_LT(recalibration.left({bias}), 0.05 * sizing.size(bias, noise));
  EXPECT_NEAR(recalibration.left({pickup}) / sizing.size(pickup, noise), 1, 0.05);
}

class EachPast : public testing::TestWithParam<protocols::Past> {};
INSTANTIATE_TEST_SUITE_P(All, EachPast,
                         testing::Values(protocols::Past{.kind = protocols::PastKind::poled_minus},
                                         protocols::Past{.kind = protocols::PastKind::unpoled},
                                         protocols::Past{.kind = protocols::PastKind::visited,
                                                         .levels = {{-9e5, 2}, {5e5, 1}}},
                                         protocols::Past{.kind = protocols::PastKind::visited,
                                                         .from = protocols::FirstState::unpoled,
                                                         .levels = {{1.2e6, 1}}}));

// Creep and relaxation too, which begin at different times.
TEST_P(EachPast, IsTheSameInModelAndTwin) {
  auto base = model::library_model("soft-pzt");
  base.load = {.spring_stiffness = 3e6, .prestress = 5e6};
  base.effects = {{"logarithmic_creep", {{"fraction_per_decade", 0.03}}},
                  {"prestress_relaxation", {{"fraction", 0.1}, {"time_constant", 0.5}}}};
  const auto twin = play(base, {}, loop.time, loop.field, {.domains = 8192, .past = GetParam()});
  const auto past = GetParam();
  const auto ours = model::simulate(base, loop.time, loop.field,
                                    {.tolerance = 1e-5, .domains = 8000, .shift = 0, .past = &past});
  EXPECT_LT(apart(model::channel_of(ours, Channel::charge), twin.charge), 1e-3);
  EXPECT_LT(apart(model::channel_of(ours, Channel::displacement), twin.displacement), 1e-3);
  EXPECT_LT(apart(model::channel_of(ours, Channel::force), twin.force), 1e-3);
}

TEST(PhysicsBench, IsSizedAndVaried) {
  const BenchOptions options{.domains = 480, .low_noise = true, .few_recordings = true, .charge_only = true};
  const auto bench = make_bench(11, 1, Kind::physics, options);
  ASSERT_EQ(bench.physics.size(), 1u);
  ASSERT_EQ(bench.effects.size(), 1u);
  EXPECT_GT(bench.left, 0.15);
  EXPECT_LT(bench.left, 6);
  EXPECT_GT(bench.sizes[0] / bench.left, 1.6);
  EXPECT_LT(bench.sizes[0] / bench.left, 45);
  ASSERT_EQ(bench.recordings.size(), 3u);
  EXPECT_EQ(bench.recordings[0].name, "slow_loops");
  for (const auto& [name, r] : bench.recordings) {
    EXPECT_TRUE(r.has(Channel::charge)) << name;
    EXPECT_FALSE(r.has(Channel::displacement)) << name;
    EXPECT_FALSE(r.has(Channel::force)) << name;
    EXPECT_EQ(r.header.load.spring_stiffness, 0) << name;
  }
  const auto& charge = bench.recordings[0].recording.at(Channel::charge);
  const double range = std::ranges::max(charge) - std::ranges::min(charge);
  EXPECT_LT(bench.noise.at(Channel::charge), 3e-4 * range);
  const auto truth = truth_of(bench);
  EXPECT_EQ(truth.at("physics").size(), 1u);
  EXPECT_EQ(truth.at("left").get<double>(), bench.left);
}

}  // namespace
}  // namespace ferrobench::campaign

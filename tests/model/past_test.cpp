// A specimen's past: the state that a simulation starts in, and its derivatives.
#include "model/past.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>

#include "model/gradient_check.h"
#include "model/sensitivities.h"
#include "tests/model/random_models.h"

namespace ferrobench::model {
namespace {

using protocols::FirstState;
using protocols::Past;
using protocols::PastKind;

// A triangle that ends where it began, as loops do.
const std::vector<double> knot_time{0, 0.1, 0.3, 0.4}, knot_field{5e4, 1.7e6, -1.6e6, 5e4};

std::vector<double> times() {
  std::vector<double> out;
  for (int i = 0; i <= 80; ++i) out.push_back(0.4 * i / 80);
  return out;
}

Model polycrystal() {
  Model m = crystal();
  m.polycrystal.method = PolycrystalMethod::distribution;
  m.polycrystal.barrier_log_std = 0.3;
  m.polycrystal.interaction_field_std = 1e5;
  m.polycrystal.interaction_stress_std = 5e6;
  return m;
}

Past visited(std::vector<protocols::VisitedLevel> levels, FirstState from = FirstState::poled_plus) {
  return {PastKind::visited, from, std::move(levels)};
}

std::vector<Past> pasts() {
  return {{PastKind::poled_plus},
          {PastKind::poled_minus},
          {PastKind::unpoled},
          visited({{-1.5e6, 0.1}, {-1.5e6, 0.02}, {0, 0.1}}),
          visited({{8e5, 0.05}}, FirstState::unpoled),
          {PastKind::cycled}};
}

struct Answer {
  std::vector<double> charge = std::vector<double>(times().size()), displacement = charge, plus = charge,
                      minus = charge;
  SimulationStatistics statistics;
};

Answer answer(const Model& model, const SimulationOptions& options) {
  Answer out;
  ChannelSpans spans;
  spans.charge = out.charge;
  spans.displacement = out.displacement;
  spans.fraction_plus = out.plus;
  spans.fraction_minus = out.minus;
  out.statistics = simulate_at(model, knot_time, knot_field, times(), spans, options);
  return out;
}

Answer after(const Past& past, const Model& model = polycrystal()) {
  return answer(model, {.domains = 200, .past = &past});
}

TEST(Past, OfNothingElseTheSpecimenIsPoledTowardsPlus) {
  const auto plain = answer(polycrystal(), {.domains = 200});
  for (const auto kind : {PastKind::poled_plus, PastKind::unknown}) {
    const auto same = after({kind});
    EXPECT_EQ(same.charge, plain.charge);
    EXPECT_EQ(same.displacement, plain.displacement);
    EXPECT_EQ(same.statistics.steps, plain.statistics.steps);
  }
}

TEST(Past, PoledTowardsMinusIsTheMirror) {
  // With no bias the wells are alike but for their sign.
  auto field = knot_field;
  for (double& e : field) e = -e;
  const auto model = polycrystal();
  const Past past{PastKind::poled_minus};
  const auto minus = answer(model, {.domains = 200, .past = &past});
  std::vector<double> charge(times().size()), displacement(times().size());
  ChannelSpans spans;
  spans.charge = charge;
  spans.displacement = displacement;
  simulate_at(model, knot_time, field, times(), spans, {.domains = 200});
  double range = 0;
  for (const double q : charge) range = std::max(range, std::abs(q));
  // The lattice of domains is not its own mirror.
  for (std::size_t i = 0; i < charge.size(); ++i) EXPECT_NEAR(minus.charge[i], -charge[i], 5e-3 * range);
}

TEST(Past, UnpoledIsAThirdInEachWellAndItsRestIsTheZero) {
  const auto a = after({PastKind::unpoled});
  EXPECT_DOUBLE_EQ(a.plus[0], 1.0 / 3);
  EXPECT_DOUBLE_EQ(a.minus[0], 1.0 / 3);
  auto at_rest = knot_field;
  at_rest[0] = 0;
  const Past past{PastKind::unpoled};
  std::vector<double> displacement(1), force(1), time{0};
  ChannelSpans spans;
  spans.displacement = displacement;
  spans.force = force;
  auto model = polycrystal();
  model.load = {2e6, 4e6};
  simulate_at(model, knot_time, at_rest, time, spans, {.domains = 200, .past = &past});
  EXPECT_NEAR(displacement[0], 0, 1e-15);
  EXPECT_NEAR(force[0], 4e6 * model.actuator.area, 1e-9);
}

TEST(Past, PartlyPoledIsBetweenTheStatesThatHaveNames) {
  const auto partly = [](double poling) { return after({.kind = PastKind::partly_poled, .poling = poling}); };
  EXPECT_EQ(partly(-1).charge, after({PastKind::poled_minus}).charge);
  EXPECT_EQ(partly(0).charge, after({PastKind::unpoled}).charge);
  EXPECT_EQ(partly(1).charge, after({PastKind::poled_plus}).charge);
  EXPECT_DOUBLE_EQ(partly(-0.4).minus[0], 0.6);
  EXPECT_DOUBLE_EQ(partly(-0.4).plus[0], 0.2);
  // A program that switches little leaves most of it: the domains' own fields take a part.
  const Past past{.kind = PastKind::cycled, .from = FirstState::partly_poled, .poling = 0.4};
  const std::vector<double> weak{0, 1e5, -1e5, 0};
  std::vector<double> plus(times().size());
  ChannelSpans spans;
  spans.fraction_plus = plus;
  simulate_at(polycrystal(), knot_time, weak, times(), spans, {.domains = 200, .past = &past});
  EXPECT_NEAR(plus.back(), 0.6, 0.1);
}

// What was visited is what a longer run shows after its first part.
TEST(Past, VisitedLevelsAreTheFirstPartOfALongerRun) {
  const auto model = polycrystal();
  const auto past = visited({{-1.5e6, 0.1}, {5e4, 0.1}});
  const auto short_run = after(past, model);
  Simulator whole(model, {.domains = 200});
  whole.start(0);
  whole.play(0.1, -1.5e6, {}, {});
  whole.play(0.1, 5e4, {}, {});
  std::vector<double> charge(1);
  ChannelSpans spans;
  spans.charge = charge;
  for (std::size_t k = 1; k < knot_time.size(); ++k) {
    const std::vector<double> at{knot_time[k] + 0.2};
    whole.play(at[0] - whole.time(), knot_field[k], at, spans);
    const auto row = static_cast<std::size_t>(std::lround(knot_time[k] / 0.4 * 80));
    EXPECT_NEAR(short_run.charge[row], charge[0], 1e-9 * std::abs(charge[0]));
  }
}

TEST(Past, ALevelIsLeftAsFastAsItWasReached) {
  const auto by_itself = after(visited({{-1.5e6, 0.1}}));
  const auto led_back = after(visited({{-1.5e6, 0.1}, {5e4, 1.55e6 / 1.5e7}}));
  for (std::size_t i = 0; i < by_itself.charge.size(); ++i)
    EXPECT_NEAR(by_itself.charge[i], led_back.charge[i], 1e-6 * std::abs(led_back.charge[i]));
}

TEST(Past, ACycledSpecimenRepeatsItself) {
  const auto a = after({PastKind::cycled});
  EXPECT_NEAR(a.plus.front(), a.plus.back(), 2e-3);
  EXPECT_NEAR(a.minus.front(), a.minus.back(), 2e-3);
  EXPECT_LT(a.plus.front(), 0.5);  // unlike a fresh one
}

// What the bench does in time begins with the recording, whatever went before.
TEST(Past, TimeBeginsWithTheRecording) {
  auto model = polycrystal();
  const auto plain = after(visited({{-1.5e6, 100}, {5e4, 100}}), model);
  model.effects = {{"displacement_drift", {{"rate", 1e-6}}},
                   {"charge_offset_current", {{"current", 1e-6}}},
                   {"dielectric_leakage", {{"resistivity", 1e8}}}};
  const auto drifting = after(visited({{-1.5e6, 100}, {5e4, 100}}), model);
  EXPECT_DOUBLE_EQ(drifting.displacement[0], plain.displacement[0]);
  EXPECT_DOUBLE_EQ(drifting.charge[0], plain.charge[0]);
  EXPECT_NEAR(drifting.displacement.back() - plain.displacement.back(), 0.4e-6, 1e-12);
}

TEST(Past, PrestressHasNotRelaxedBefore) {
  auto model = polycrystal();
  model.load = {2e6, 4e6};
  model.effects = {{"prestress_relaxation", {{"fraction", 0.5}, {"time_constant", 0.1}}}};
  const auto past = visited({{1e3, 10}});
  std::vector<double> force(1), time{0};
  ChannelSpans spans;
  spans.force = force;
  simulate_at(model, knot_time, std::vector<double>{0, 0, 0, 0}, time, spans, {.domains = 50, .past = &past});
  EXPECT_NEAR(force[0], 4e6 * model.actuator.area, 0.05 * force[0]);  // half of it, had it relaxed
}

TEST(Past, OfAParametrizedPolycrystalIsPoledTowardsPlus) {
  auto model = polycrystal();
  model.polycrystal.method = PolycrystalMethod::parametrized;
  auto& force = model.polycrystal.critical_force.emplace();
  force.load = {{0, 1e5}, {1, 1e5}};
  force.unload = {{0, 2e5}, {1, 2e5}};
  const Past minus{PastKind::poled_minus};
  try {
    answer(model, {.past = &minus});
    ADD_FAILURE();
  } catch (const Error& e) {
    EXPECT_EQ(e.code(), ErrorCode::bad_model);
  }
}

TEST(Past, AProgramThatIsNotKnownHasNoCycles) {
  const Past past{PastKind::cycled};
  Simulator simulator(polycrystal(), {.domains = 50, .past = &past});
  EXPECT_THROW(simulator.start(0), Error);
}

TEST(Past, SlopesAreThoseOfDifferences) {
  const auto t = times();
  for (const double stiffness : {0.0, 2e6})
    for (const auto& past : pasts()) {
      SCOPED_TRACE(protocols::in_words(past));
      auto model = polycrystal();
      model.load = {stiffness, 4e6};
      model.effects = {{"viscoelastic_creep", {{"compliance", 1e-12}, {"time_constant", 0.1}}},
                       {"amplifier_lag", {{"time_constant", 1e-3}}}};
      const std::vector<CheckedParameter> parameters{{"material.barrier"},
                                                     {"material.remanent_polarization"},
                                                     {"material.remanent_strain_90"},
                                                     {"material.relaxation_time"},
                                                     {"polycrystal.interaction_field_std"},
                                                     {"polycrystal.bias_field", 1e5},
                                                     {"effects.viscoelastic_creep.time_constant"}};
      for (const auto& c : check_gradient(model, parameters, knot_time, knot_field, t,
                                          {.simulation = {.domains = 64, .past = &past}}))
        if (c.largest > 1e-10) {
          EXPECT_LT(c.error, c.largest > 1e-4 ? 1e-5 : 2e-4)
              << c.parameter << " in " << c.channel << ", largest " << c.largest;
        }
    }
}

TEST(Past, ValuesAreTheSameBitsWithSlopes) {
  const auto t = times();
  auto model = polycrystal();
  model.load = {2e6, 4e6};
  const std::vector<std::string> wanted{"material.barrier"};
  for (const auto& past : pasts()) {
    SCOPED_TRACE(protocols::in_words(past));
    const SimulationOptions options{.domains = 64, .past = &past};
    const auto plain = answer(model, options);
    std::vector<double> beside(t.size()), slopes(t.size());
    ChannelSpans out;
    out.displacement = beside;
    SlopeSpans wanted_slopes;
    wanted_slopes.displacement = slopes;
    EXPECT_EQ(
        simulate_with_slopes(model, wanted, knot_time, knot_field, t, out, wanted_slopes, options).steps,
        plain.statistics.steps);
    EXPECT_EQ(plain.displacement, beside);
  }
}

// One simulation, seen through the sensors of each, gives what each gives alone, after a past as well.
TEST(Sensors, OfModelsThatAreAlikeSeeTheSameBitsTogether) {
  std::vector<Model> models{polycrystal()};
  for (const auto& effect : effect_catalogue()) {
    if (!is_sensor(effect.family)) continue;
    auto& setting = models.emplace_back(polycrystal()).effects.emplace_back();
    setting.id = effect.id;
    for (const auto& p : effect.parameters)
      setting.parameters.emplace_back(p.name, std::sqrt(p.low * p.high));
  }
  ASSERT_GT(models.size(), 8);
  const auto t = times();
  const auto into = [](std::array<std::vector<double>, 3>& columns) {
    ChannelSpans spans;
    spans.charge = columns[0];
    spans.displacement = columns[1];
    spans.force = columns[2];
    return spans;
  };
  for (const auto& past : pasts()) {
    const SimulationOptions options{.domains = 40, .past = &past};
    std::vector<std::array<std::vector<double>, 3>> together(models.size());
    std::vector<ChannelSpans> spans;
    for (auto& columns : together) {
      columns.fill(std::vector<double>(t.size()));
      spans.push_back(into(columns));
    }
    const auto steps = simulate_alike(models, knot_time, knot_field, t, spans, options).steps;
    for (std::size_t i = 0; i < models.size(); ++i) {
      auto alone = together[i];
      EXPECT_EQ(simulate_at(models[i], knot_time, knot_field, t, into(alone), options).steps, steps);
      EXPECT_EQ(alone, together[i]) << (i > 0 ? models[i].effects[0].id : "none");
    }
  }
}

}  // namespace
}  // namespace ferrobench::model

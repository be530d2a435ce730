#include "tests/model/effects_reference.h"

#include <gtest/gtest.h>

namespace ferrobench::model {
namespace {

struct Case {
  std::string id;
  Parameters parameters;
};

// Strong enough to be seen in a loop of half a second.
const std::vector<Case> cases{
    {"none", {}},
    {"barrier_distribution", {{"log_std", 0.3}}},
    {"interaction_field_distribution", {{"std", 2e5}}},
    {"internal_bias_field", {{"field", -2e5}}},
    {"stress_stabilized_90", {{"coefficient", 2e-8}}},
    {"domain_wall_drag", {{"coefficient", 2e4}}},
    {"mean_field_interaction", {{"coefficient", 1e6}}},
    {"logarithmic_creep", {{"fraction_per_decade", 0.05}}},
    {"electrostriction", {{"coefficient", 2e-16}}},
    {"nonlinear_permittivity", {{"coefficient", 1e-13}}},
    {"polarization_fatigue", {{"coefficient", 0.1}}},
    {"dielectric_leakage", {{"resistivity", 1e7}}},
    {"self_heating", {{"strain_per_energy_density", 5e-10}, {"time_constant", 0.2}}},
    {"viscoelastic_creep", {{"compliance", 1e-11}, {"time_constant", 0.05}}},
    {"passive_layer_compliance", {{"stiffness", 2e7}}},
    {"prestress_relaxation", {{"fraction", 0.2}, {"time_constant", 0.2}}},
    {"contact_gap", {{"gap", 2e-6}}},
    {"spring_hardening", {{"coefficient", 1e4}}},
    {"guide_friction", {{"force", 10}, {"presliding_distance", 1e-6}}},
    {"stage_inertia", {{"mass", 20}, {"damping_ratio", 0.05}}},
    {"amplifier_lag", {{"time_constant", 5e-3}}},
    {"amplifier_slew_limit", {{"rate", 1.7e7}}},
    {"source_resistance", {{"coefficient", 5e4}}},
    {"charge_amplifier_decay", {{"time_constant", 1}}},
    {"charge_offset_current", {{"current", 1e-3}}},
    {"displacement_drift", {{"rate", 1e-5}}},
    {"displacement_lag", {{"time_constant", 5e-3}}},
    {"displacement_delay", {{"delay", 5e-3}}},
    {"displacement_crosstalk", {{"coefficient", 2e-12}}},
    {"displacement_clipping", {{"limit", 8e-6}}},
    {"displacement_nonlinearity", {{"coefficient", 1e4}}},
    {"load_cell_creep", {{"fraction", 0.1}, {"time_constant", 0.1}}},
    {"load_cell_lag", {{"time_constant", 5e-3}}},
    {"mains_pickup", {{"amplitude", 1e-6}, {"frequency", 50}}},
    {"empirical_asymmetry", {{"log_ratio", 0.1}}},
    {"empirical_skewness", {{"skewness", -0.7}}},
    {"empirical_tails", {{"inverse_freedom", 0.25}}},
    {"empirical_direct", {{"rate_ratio", 1}, {"barrier_ratio", 1.3}}},
    {"empirical_strain", empirical_values("empirical_strain", 5e-5, 0.05)},
    {"empirical_polarization", empirical_values("empirical_polarization", 2e-2, 0.05)},
    {"empirical_rate", empirical_values("empirical_rate", 1e5, 0.05)},
    {"empirical_drive", empirical_values("empirical_drive", 1e5, 0.05)},
    {"empirical_spring", empirical_values("empirical_spring", 1e-6, 0)}};

class AgainstTinySteps : public testing::TestWithParam<Case> {};
INSTANTIATE_TEST_SUITE_P(Effects, AgainstTinySteps, testing::ValuesIn(cases),
                         [](const auto& tested) { return tested.param.id; });

TEST_P(AgainstTinySteps, SameLoopAndHold) {
  const auto& [id, parameters] = GetParam();
  auto m = crystal();
  std::map<std::string, double> named;
  for (const auto& [name, value] : parameters) named[id + "." + name] = value;
  if (shapes_spreads(id)) {
    m.effects.push_back({"barrier_distribution", {{"log_std", 0.3}}});
    named["barrier_distribution.log_std"] = 0.3;
  }
  if (!parameters.empty()) m.effects.push_back({id, parameters});
  const bool spread = shapes_spreads(id) || id.ends_with("_distribution");
  for (const Program& program :
       {loop(), Program{{{0, 0}, {0.03, -1.1e6}, {0.23, -1.1e6}, {0.26, 0}}, 1e-3}}) {
    const auto ours = run(m, program);
    const auto theirs = Reference(crystal(), named).play(program, spread ? 1e-5 : 4e-6);
    const double q = apart(theirs.charge, ours.charge), x = apart(theirs.displacement, ours.displacement),
                 f = apart(theirs.force, ours.force), e = apart(theirs.field, ours.field);
    RecordProperty("charge", std::to_string(q));
    RecordProperty("displacement", std::to_string(x));
    RecordProperty("force", std::to_string(f));
    EXPECT_LT(e, 1e-3);
    EXPECT_LT(q, 3e-3);
    EXPECT_LT(x, 3e-3);
    EXPECT_LT(f, 3e-3);
  }
}

// Without a spring nothing but P_+ changes in a hold, and the rates must see it.
TEST(EffectReference, FatigueInAHoldWithoutSpring) {
  auto m = crystal();
  m.load.spring_stiffness = 0;
  const Program program{{{0, 0}, {0.03, -0.7e6}, {1.03, -0.7e6}, {1.06, 0}}, 2e-3};
  const auto ours = run(with(m, "polarization_fatigue", {{"coefficient", 0.5}}), program);
  const auto theirs = Reference(m, {{"polarization_fatigue.coefficient", 0.5}}).play(program, 4e-6);
  EXPECT_LT(apart(theirs.charge, ours.charge), 3e-3);
  EXPECT_LT(apart(theirs.displacement, ours.displacement), 3e-3);
}

TEST(EffectReference, CoversTheCatalogue) {
  for (const auto& effect : effect_catalogue())
    EXPECT_TRUE(std::any_of(cases.begin(), cases.end(), [&](const Case& c) { return c.id == effect.id; }))
        << effect.id;
}

}  // namespace
}  // namespace ferrobench::model

// The twin against the reference recordings, and the model against the twin.
#include "tests/campaign/twin.h"

#include <gtest/gtest.h>

#include <cstdlib>

#include "model/on_recording.h"
#include "recordings/file/reader.h"
#include "tests/model/effects_support.h"

namespace ferrobench::campaign {
namespace {

using model::apart;
using recordings::Channel;

const std::vector<double>& column(const Response& r, Channel c) {
  switch (c) {
    case Channel::charge:
      return r.charge;
    case Channel::displacement:
      return r.displacement;
    case Channel::force:
      return r.force;
    default:
      return r.field;
  }
}

class EachReference : public testing::TestWithParam<std::string> {};

TEST_P(EachReference, IsGivenBackByTheTwin) {
  const auto recording = recordings::read_recording(std::string(MODEL_REFERENCE) + "/" + GetParam() + ".h5");
  const auto source = recording.has(Channel::command) ? Channel::command : Channel::field;
  const auto setting = model::model_for(model::model_from_json(recording.header.model), recording.header);
  const auto twin = play(setting, {}, recording.time, recording.at(source));
  for (const auto channel : {Channel::charge, Channel::displacement, Channel::force}) {
    const auto& theirs = recording.at(channel);
    const auto [low, high] = std::minmax_element(theirs.begin(), theirs.end());
    if (*high - *low < 1e-9) continue;  // no spring: the force does not move
    const double error = apart(theirs, column(twin, channel));
    EXPECT_LT(error, 3e-4) << channel_name(channel);
  }
}

INSTANTIATE_TEST_SUITE_P(All, EachReference,
                         testing::Values("single_crystal_free", "single_crystal_spring",
                                         "polycrystal_full_loops", "polycrystal_minor_loops",
                                         "polycrystal_creep_holds", "polycrystal_passive_layers"),
                         [](const auto& i) { return i.param; });

// Large loops, a hold, and loops that get smaller: partly switched states are the hard ones.
const model::Program hard{{{0, 0},
                           {0.2, -2e6},
                           {0.6, 2e6},
                           {0.8, 0},
                           {0.81, -6e5},
                           {1.8, -6e5},
                           {2.0, 1e6},
                           {2.2, -7e5},
                           {2.4, 5e5},
                           {2.6, -4e5},
                           {2.8, 3e5},
                           {3.0, -3e5},
                           {3.2, 3e5}},
                          4e-3};

// A quarter of its steps and four times its domains.
TEST(Twin, IsConverged) {
  const auto& program = hard;
  const auto setting = model::library_model("soft-pzt");
  const auto plain = play(setting, {}, program.time, program.field);
  const auto finer = play(setting, {}, program.time, program.field, {.domains = 16384, .path = 0.25});
  const auto more = play(setting, {}, program.time, program.field, {.domains = 65536});
  for (const auto channel : {Channel::charge, Channel::displacement}) {
    EXPECT_LT(apart(column(plain, channel), column(finer, channel)), 1e-4) << channel_name(channel);
    EXPECT_LT(apart(column(plain, channel), column(more, channel)), 2e-4) << channel_name(channel);
  }
}

// Spreads of fields and barriers that count alike: no rule that is coarse along one of them would do.
TEST(Twin, IsTheModelInPartlySwitchedStates) {
  auto setting = model::library_model("soft-pzt");
  setting.effects.clear();
  setting.material.barrier = 42.7e3;
  setting.polycrystal.barrier_log_std = 0.23;
  setting.polycrystal.interaction_field_std = 1.3e5;
  const auto twin = play(setting, {}, hard.time, hard.field);
  const auto ours =
      model::simulate(setting, hard.time, hard.field, {.tolerance = 1e-5, .domains = 20000, .shift = 0});
  for (const auto channel : {Channel::charge, Channel::displacement})
    EXPECT_LT(apart(model::channel_of(ours, channel), column(twin, channel)), 2e-4) << channel_name(channel);
}

struct Case {
  std::string id;
  model::Parameters parameters;
};
void PrintTo(const Case& c, std::ostream* out) {
  *out << c.id;
}

// Strengths that show, on a polycrystal with a spring.
const std::vector<Case> cases{{"none", {}},
                              {"barrier_distribution", {{"log_std", 0.3}}},
                              {"interaction_field_distribution", {{"std", 2e5}}},
                              {"internal_bias_field", {{"field", -2e5}}},
                              {"stress_stabilized_90", {{"coefficient", 2e-8}}},
                              {"domain_wall_drag", {{"coefficient", 2e4}}},
                              {"mean_field_interaction", {{"coefficient", 5e5}}},
                              {"logarithmic_creep", {{"fraction_per_decade", 0.03}}},
                              {"electrostriction", {{"coefficient", 1e-16}}},
                              {"nonlinear_permittivity", {{"coefficient", 1e-13}}},
                              {"polarization_fatigue", {{"coefficient", 0.05}}},
                              {"dielectric_leakage", {{"resistivity", 3e7}}},
                              {"self_heating", {{"strain_per_energy_density", 3e-10}, {"time_constant", 1}}},
                              {"viscoelastic_creep", {{"compliance", 1e-11}, {"time_constant", 0.3}}},
                              {"passive_layer_compliance", {{"stiffness", 2e7}}},
                              {"prestress_relaxation", {{"fraction", 0.2}, {"time_constant", 0.5}}},
                              {"contact_gap", {{"gap", 2e-6}}},
                              {"spring_hardening", {{"coefficient", 1e4}}},
                              {"guide_friction", {{"force", 5}, {"presliding_distance", 5e-7}}},
                              {"stage_inertia", {{"mass", 5}, {"damping_ratio", 0.05}}},
                              {"amplifier_lag", {{"time_constant", 5e-3}}},
                              {"amplifier_slew_limit", {{"rate", 2e7}}},
                              {"source_resistance", {{"coefficient", 2e4}}},
                              {"charge_amplifier_decay", {{"time_constant", 5}}},
                              {"charge_offset_current", {{"current", 1e-4}}},
                              {"displacement_drift", {{"rate", 2e-6}}},
                              {"displacement_lag", {{"time_constant", 5e-3}}},
                              {"displacement_delay", {{"delay", 5e-3}}},
                              {"displacement_crosstalk", {{"coefficient", 1e-12}}},
                              {"displacement_clipping", {{"limit", 6e-6}}},
                              {"displacement_nonlinearity", {{"coefficient", 1e4}}},
                              {"load_cell_creep", {{"fraction", 0.1}, {"time_constant", 0.5}}},
                              {"load_cell_lag", {{"time_constant", 5e-3}}},
                              {"mains_pickup", {{"amplitude", 5e-7}, {"frequency", 50}}}};

class EachEffect : public testing::TestWithParam<Case> {};
INSTANTIATE_TEST_SUITE_P(Catalogue, EachEffect, testing::ValuesIn(cases),
                         [](const auto& tested) { return tested.param.id; });

// Slow and fast switching, a hold, fast steps: model and twin within 0.2 % of each channel's range.
TEST_P(EachEffect, IsTheSameInModelAndTwin) {
  const auto& [id, parameters] = GetParam();
  auto base = model::library_model("soft-pzt");
  base.material.permittivity_90 = 3e-8;
  base.material.compliance_90 = 2.2e-11;
  base.polycrystal.bias_field = 3e4;
  if (id == "barrier_distribution") base.polycrystal.barrier_log_std = 0;
  if (id == "interaction_field_distribution") base.polycrystal.interaction_field_std = 0;
  if (id == "internal_bias_field") base.polycrystal.bias_field = 0;
  const model::Program program{{{0, 0},
                                {0.1, -2e6},
                                {0.3, 2e6},
                                {0.5, -4e5},
                                {1.3, -4e5},
                                {1.31, -1.5e6},
                                {1.4, -1.5e6},
                                {1.41, 1e6},
                                {1.5, 1e6},
                                {2.5, 0}},
                               1e-3};
  std::vector<model::EffectSetting> hidden;
  if (!parameters.empty()) hidden.push_back({id, parameters});
  const auto twin = play(base, hidden, program.time, program.field);
  auto with = base;
  with.effects = hidden;
  const auto ours =
      model::simulate(with, program.time, program.field, {.tolerance = 1e-5, .domains = 8000, .shift = 0});
  for (const auto channel : {Channel::field, Channel::charge, Channel::displacement, Channel::force}) {
    const double error = apart(model::channel_of(ours, channel), column(twin, channel));
    if (std::getenv("FERROBENCH_SHOW_ERRORS") != nullptr)
      std::printf("  %s %s %.1e\n", id.c_str(), std::string(channel_name(channel)).c_str(), error);
    EXPECT_LT(error, 2e-3) << channel_name(channel);
  }
}

TEST(CampaignEffects, OfTheCatalogueIsThere) {
  // The twin knows named terms only; a table is fitted to what it leaves.
  for (const auto& effect : model::effect_catalogue())
    EXPECT_TRUE(effect.empirical ||
                std::any_of(cases.begin(), cases.end(), [&](const Case& c) { return c.id == effect.id; }))
        << effect.id;
}

}  // namespace
}  // namespace ferrobench::campaign

#include <gtest/gtest.h>

#include <algorithm>

#include "tests/model/effects_support.h"

namespace ferrobench::model {
namespace {

// Typical values: the geometric mean of the plausible range.
EffectSetting typical(const Effect& e) {
  EffectSetting out{.id = std::string(e.id), .parameters = {}};
  for (const auto& p : e.parameters) out.parameters.emplace_back(p.name, std::sqrt(p.low * p.high));
  return out;
}

// A crystal, with spreads where an effect is about their shape.
Model base_for(const Effect& e) {
  auto m = crystal();
  if (!shapes_spreads(e.id)) return m;
  m.polycrystal.method = PolycrystalMethod::distribution;
  m.polycrystal.barrier_log_std = 0.3;
  m.polycrystal.interaction_field_std = 1e5;
  return m;
}

TEST(EffectCatalogue, HoldsEveryEffectOfTheSpecification) {
  const std::vector<std::string> wanted{"barrier_distribution",
                                        "interaction_field_distribution",
                                        "internal_bias_field",
                                        "stress_stabilized_90",
                                        "domain_wall_drag",
                                        "mean_field_interaction",
                                        "logarithmic_creep",
                                        "electrostriction",
                                        "nonlinear_permittivity",
                                        "polarization_fatigue",
                                        "dielectric_leakage",
                                        "self_heating",
                                        "viscoelastic_creep",
                                        "passive_layer_compliance",
                                        "prestress_relaxation",
                                        "contact_gap",
                                        "spring_hardening",
                                        "guide_friction",
                                        "stage_inertia",
                                        "amplifier_lag",
                                        "amplifier_slew_limit",
                                        "source_resistance",
                                        "charge_amplifier_decay",
                                        "charge_offset_current",
                                        "displacement_drift",
                                        "displacement_lag",
                                        "displacement_delay",
                                        "displacement_crosstalk",
                                        "displacement_clipping",
                                        "displacement_nonlinearity",
                                        "load_cell_creep",
                                        "load_cell_lag",
                                        "mains_pickup"};
  for (const auto& id : wanted) EXPECT_EQ(find_effect(id).id, id);
  EXPECT_GE(effect_catalogue().size(), wanted.size());
}

class EveryEffect : public testing::TestWithParam<std::size_t> {
 protected:
  const Effect& effect() const { return effect_catalogue()[GetParam()]; }
};
INSTANTIATE_TEST_SUITE_P(Catalogue, EveryEffect, testing::Range<std::size_t>(0, effect_catalogue().size()),
                         [](const auto& tested) { return std::string(effect_catalogue()[tested.param].id); });

TEST_P(EveryEffect, SaysWhatItIs) {
  EXPECT_FALSE(effect().equation.empty());
  EXPECT_FALSE(effect().shows.empty());
  ASSERT_FALSE(effect().parameters.empty());
  for (const auto& p : effect().parameters) {
    EXPECT_FALSE(p.unit.empty()) << p.name;
    EXPECT_LT(0, p.low) << p.name;
    EXPECT_LT(p.low, p.high) << p.name;
  }
}

TEST_P(EveryEffect, GoesThroughAModelFile) {
  auto m = crystal();
  m.effects.push_back(typical(effect()));
  const auto json = to_json(m);
  EXPECT_EQ(to_json(model_from_json(json)), json);
  for (const auto& p : effect().parameters) {
    auto broken = json;
    broken["effects"][0]["parameters"].erase(std::string(p.name));
    EXPECT_THROW(model_from_json(broken), Error);
    if (p.any_sign) continue;
    broken = json;
    broken["effects"][0]["parameters"][std::string(p.name)] = -1;
    EXPECT_THROW(model_from_json(broken), Error);
  }
}

TEST_P(EveryEffect, RunsWithFiniteResults) {
  auto m = crystal();
  m.effects.push_back(typical(effect()));
  for (const auto& program : {loop(), held(), rest()}) {
    const auto out = run(m, program);
    for (const auto* column : {&out.field, &out.charge, &out.displacement, &out.force})
      EXPECT_TRUE(std::all_of(column->begin(), column->end(), [](double v) { return std::isfinite(v); }));
  }
}

TEST_P(EveryEffect, ChangesWhatIsMeasuredAndLeavesNothingBehind) {
  const auto before = run(base_for(effect()), loop());
  auto m = base_for(effect());
  m.effects.push_back(typical(effect()));
  for (auto& [name, value] : m.effects[0].parameters)
    if (effect().id == "displacement_clipping" || effect().id == "amplifier_slew_limit")
      value = effect().parameters[0].low;
  const auto with_effect = run(m, loop());
  EXPECT_TRUE(before.field != with_effect.field || before.charge != with_effect.charge ||
              before.displacement != with_effect.displacement || before.force != with_effect.force);
  const auto after = run(base_for(effect()), loop());
  EXPECT_EQ(before.charge, after.charge);
  EXPECT_EQ(before.displacement, after.displacement);
  EXPECT_EQ(before.force, after.force);
}

// Effects that fade with their first parameter, and those that fade as it grows.
TEST_P(EveryEffect, FadesIntoTheBaseModel) {
  const std::string id(effect().id);
  const bool fades_up = id == "dielectric_leakage" || id == "passive_layer_compliance" ||
                        id == "amplifier_slew_limit" || id == "charge_amplifier_decay" ||
                        id == "displacement_clipping";
  auto m = base_for(effect());
  m.effects.push_back(typical(effect()));
  m.effects[0].parameters[0].second =
      fades_up ? 1e6 * effect().parameters[0].high : 1e-7 * effect().parameters[0].low;
  // A gap of nothing still does not pull.
  const auto program = id == "contact_gap" ? unipolar() : loop();
  const auto base = run(base_for(effect()), program), out = run(m, program);
  // Some take other steps on the way, which shows at the stepper's own tolerance.
  EXPECT_LT(apart(base.charge, out.charge), 3e-4);
  EXPECT_LT(apart(base.displacement, out.displacement), 3e-4);
  EXPECT_LT(apart(base.force, out.force), 3e-4);
}

TEST(EffectCatalogue, OrderInTheFileDoesNotMatter) {
  auto a = crystal();
  for (const auto* id : {"displacement_clipping", "mains_pickup", "displacement_lag", "charge_offset_current",
                         "charge_amplifier_decay", "spring_hardening", "contact_gap"})
    a.effects.push_back(typical(find_effect(id)));
  auto b = a;
  std::reverse(b.effects.begin(), b.effects.end());
  const auto one = run(a, loop()), other = run(b, loop());
  EXPECT_EQ(one.charge, other.charge);
  EXPECT_EQ(one.displacement, other.displacement);
  EXPECT_EQ(one.force, other.force);
}

TEST(EffectCatalogue, MistypedIdNamesTheNearest) {
  try {
    find_effect("amplifer_lag");
    FAIL();
  } catch (const Error& e) {
    EXPECT_NE(std::string(e.what()).find("amplifier_lag"), std::string::npos);
  }
}

}  // namespace
}  // namespace ferrobench::model

#include "tests/campaign/terms.h"

#include <cmath>
#include <functional>
#include <map>

namespace ferrobench::campaign {

Terms make_terms(const std::vector<model::EffectSetting>& effects, model::Model& model) {
  Terms t;
  auto& poly = model.polycrystal;
  const auto distributed = [&] { poly.method = model::PolycrystalMethod::distribution; };
  using V = const std::vector<double>&;
  // In the order of each effect's own list of parameters.
  const std::map<std::string, std::function<void(V)>> places{
      {"barrier_distribution",
       [&](V v) { distributed(), poly.barrier_log_std = std::hypot(poly.barrier_log_std, v[0]); }},
      {"interaction_field_distribution",
       [&](V v) {
         distributed(), poly.interaction_field_std = std::hypot(poly.interaction_field_std, v[0]);
       }},
      {"internal_bias_field", [&](V v) { distributed(), poly.bias_field += v[0]; }},
      {"stress_stabilized_90", [&](V v) { t.stabilization = v[0]; }},
      {"domain_wall_drag", [&](V v) { t.drag = v[0]; }},
      {"mean_field_interaction", [&](V v) { t.mean_field = v[0]; }},
      {"logarithmic_creep", [&](V v) { t.creep = v[0]; }},
      {"electrostriction", [&](V v) { t.electrostriction = v[0]; }},
      {"nonlinear_permittivity", [&](V v) { t.cubic_permittivity = v[0]; }},
      {"polarization_fatigue", [&](V v) { t.fatigue = v[0]; }},
      {"dielectric_leakage", [&](V v) { t.conductivity = 1 / v[0]; }},
      {"self_heating", [&](V v) { t.heat = v[0], t.heat_time = v[1]; }},
      {"viscoelastic_creep", [&](V v) { t.viscous = v[0], t.viscous_time = v[1]; }},
      {"passive_layer_compliance", [&](V v) { t.passive_compliance += 1 / v[0]; }},
      {"prestress_relaxation", [&](V v) { t.relaxation = v[0], t.relaxation_time = v[1]; }},
      {"contact_gap", [&](V v) { t.gap = v[0]; }},
      {"spring_hardening", [&](V v) { t.hardening = v[0]; }},
      {"guide_friction", [&](V v) { t.friction = v[0], t.presliding = v[1]; }},
      {"stage_inertia", [&](V v) { t.mass = v[0], t.damping_ratio = v[1]; }},
      {"amplifier_lag", [&](V v) { t.amplifier_lag = v[0]; }},
      {"amplifier_slew_limit", [&](V v) { t.slew_rate = v[0]; }},
      {"source_resistance", [&](V v) { t.source_resistance = v[0]; }},
      {"charge_amplifier_decay", [&](V v) { t.charge_decay = v[0]; }},
      {"charge_offset_current", [&](V v) { t.offset_current = v[0]; }},
      {"displacement_drift", [&](V v) { t.drift = v[0]; }},
      {"displacement_lag", [&](V v) { t.displacement_lag = v[0]; }},
      {"displacement_delay", [&](V v) { t.delay = v[0]; }},
      {"displacement_crosstalk", [&](V v) { t.crosstalk = v[0]; }},
      {"displacement_clipping", [&](V v) { t.limit = v[0]; }},
      {"displacement_nonlinearity", [&](V v) { t.nonlinearity = v[0]; }},
      {"load_cell_creep", [&](V v) { t.cell_creep = v[0], t.cell_creep_time = v[1]; }},
      {"load_cell_lag", [&](V v) { t.cell_lag = v[0]; }},
      {"mains_pickup", [&](V v) { t.pickup = v[0], t.pickup_frequency = v[1]; }},
      {"session_warming", [&](V v) { t.warming = v[0]; }},
      {"switching_asymmetry", [&](V v) { t.asymmetry = v[0]; }},
      {"piezoelectric_field_dependence", [&](V v) { t.field_dependence = v[0]; }},
      {"order_squared_strain", [&](V v) { t.order_squared = v[0]; }},
      {"spring_direction", [&](V v) { t.spring_direction = v[0]; }},
      {"amplifier_crossover", [&](V v) { t.crossover_depth = v[0], t.crossover_width = v[1]; }},
      {"dielectric_absorption", [&](V v) { t.absorption = v[0], t.absorption_time = v[1]; }},
      {"charge_gain_compression", [&](V v) { t.charge_compression = v[0]; }},
      {"displacement_play", [&](V v) { t.play = v[0]; }},
      {"force_crosstalk", [&](V v) { t.cell_crosstalk = v[0]; }},
      {"barrier_exponent", [&](V v) { t.barrier_exponent = 2 + v[0]; }},
      {"heavy_tails", [&](V v) { t.inverse_freedom = v[0]; }},
      {"direct_180_switching", [&](V v) { t.direct_rate = v[0], t.direct_barrier = v[1]; }},
      {"stretched_waiting", [&](V v) { t.stretching = 1 - v[0]; }},
      {"spring_hysteresis", [&](V v) { t.spring_width = v[0], t.spring_distance = v[1]; }}};
  if (model.actuator.passive_stiffness) t.passive_compliance = 1 / *model.actuator.passive_stiffness;
  for (const auto& effect : effects) {
    const auto place = places.find(effect.id);
    if (place == places.end())
      throw Error(ErrorCode::not_found, "the twin does not know the effect " + effect.id);
    std::vector<double> values;
    for (const auto& [name, value] : effect.parameters) values.push_back(value);
    place->second(values);
  }
  return t;
}

}  // namespace ferrobench::campaign

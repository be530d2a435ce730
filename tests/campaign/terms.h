// The hidden effects' parameters by place, neutral where an effect is absent. Catalogue and outsiders alike.
#pragma once

#include <optional>
#include <vector>

#include "model/model.h"

namespace ferrobench::campaign {

struct Terms {
  // drive
  double amplifier_lag = 0;         // s
  std::optional<double> slew_rate;  // V/m/s
  double crossover_depth = 0, crossover_width = 1;
  double source_resistance = 0;
  // kinetics
  double stabilization = 0, drag = 0, fatigue = 0, mean_field = 0;
  double warming = 0, asymmetry = 0;
  double barrier_exponent = 2;
  double inverse_freedom = 0;  // of Student's t, which spreads the domains; 0: the normal distribution
  double direct_rate = 0, direct_barrier = 1;  // of + <-> -, over those of 90
  double stretching = 1;                       // exponent of the waiting times
  // polarization and charge
  double cubic_permittivity = 0;  // m^2/V^2
  double conductivity = 0;        // S/m
  std::optional<double> charge_decay;
  double offset_current = 0;
  double absorption = 0, absorption_time = 1;
  double charge_compression = 0;
  // strain
  double creep = 0, electrostriction = 0, heat = 0, heat_time = 1, viscous = 0, viscous_time = 1;
  double field_dependence = 0, order_squared = 0;
  // mechanics
  double passive_compliance = 0;  // m/N
  double relaxation = 0, relaxation_time = 1;
  std::optional<double> gap;
  double hardening = 0;
  double spring_direction = 0, spring_width = 0, spring_distance = 0.5e-6;  // 1, m, m
  bool spring_remembers() const { return spring_direction != 0 || spring_width != 0; }
  double friction = 0, presliding = 1;
  double mass = 0, damping_ratio = 0;
  // displacement and force sensors
  double drift = 0, crosstalk = 0, nonlinearity = 0, displacement_lag = 0, delay = 0, play = 0;
  double pickup = 0, pickup_frequency = 0;
  std::optional<double> limit;
  double cell_creep = 0, cell_creep_time = 1, cell_lag = 0, cell_crosstalk = 0;
};

// Sets the terms; spreads and bias go into the model's polycrystal. Error(not_found) for an unknown id.
Terms make_terms(const std::vector<model::EffectSetting>& effects, model::Model& model);

}  // namespace ferrobench::campaign

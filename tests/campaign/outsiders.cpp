#include "tests/campaign/outsiders.h"

namespace ferrobench::campaign {

std::span<const Outsider> outsiders() {
  using model::Family;
  using enum model::Sign;
  static const std::vector<Outsider> all{
      {.id = "session_warming",
       .equation = "rates times exp(rate t), t from the start of the session",
       .family = Family::kinetics,
       .parameters = {{"rate", "1/s", 1e-5, 0.1, any}}},
      {.id = "switching_asymmetry",
       .equation = "barriers towards + times 1 + fraction, towards - times 1 - fraction",
       .family = Family::kinetics,
       .parameters = {{"fraction", "1", 1e-4, 0.5, any}}},
      {.id = "piezoelectric_field_dependence",
       .equation = "S += coefficient (x+ - x-) E |E|",
       .family = Family::strain,
       .parameters = {{"coefficient", "m^2/V^2", 1e-19, 1e-15, any}}},
      {.id = "order_squared_strain",
       .equation = "S += strain ((x+ - x-)^2 - 1)",
       .family = Family::strain,
       .parameters = {{"strain", "1", 1e-7, 5e-3, any}}},
      {.id = "spring_direction",
       .equation = "F_spring = k x (1 + fraction z), z Dahl's state over 0.5 um",
       .family = Family::equilibrium,
       .parameters = {{"fraction", "1", 1e-4, 0.5, any}}},
      {.id = "amplifier_crossover",
       .equation = "E_mon = E - depth tanh(E / width) exp(-(E / (4 width))^2)",
       .family = Family::drive,
       .parameters = {{"depth", "V/m", 1e2, 3e5}, {"width", "V/m", 3e4, 2e5, above_zero}}},
      {.id = "dielectric_absorption",
       .equation = "Qm = Q + fraction lag(Q - Q(0))",
       .family = Family::charge_sensor,
       .parameters = {{"fraction", "1", 1e-5, 0.5, any}, {"time_constant", "s", 0.05, 20, above_zero}}},
      {.id = "charge_gain_compression",
       .equation = "Qm = Q (1 - coefficient Q^2)",
       .family = Family::charge_sensor,
       .parameters = {{"coefficient", "1/C^2", 1e-3, 1e8, any}}},
      {.id = "displacement_play",
       .equation = "xm follows x with a play of 2 width",
       .family = Family::displacement_sensor,
       .parameters = {{"width", "m", 1e-10, 1e-5}}},
      {.id = "force_crosstalk",
       .equation = "Fm = F + coefficient E_mon",
       .family = Family::force_sensor,
       .parameters = {{"coefficient", "N m/V", 1e-10, 1e-3, any}}}};
  return all;
}

const Outsider& outsider(std::string_view id) {
  for (const auto& o : outsiders())
    if (o.id == id) return o;
  throw Error(ErrorCode::not_found, "there is no outsider " + std::string(id));
}

}  // namespace ferrobench::campaign

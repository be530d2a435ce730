#include "model/effects/catalogue.h"

namespace ferrobench::model::effects {

Effect effect_dielectric_leakage() {
  return {
      .id = "dielectric_leakage",
      .equation = "charge += n A integral E / resistivity dt",
      .family = Family::polarization,
      .parameters = {{"resistivity", "ohm m", 1e6, 1e12, Sign::off_at_infinity}},
      .shows = "charge, in step with the integral of the field: holds at field run away, loops do not close",
      .install = [](std::span<const double> v, Model&, Ports& ports) {
        ports.conduction.emplace_back([resistivity = v[0]](double field) { return field / resistivity; });
      }};
}

}  // namespace ferrobench::model::effects

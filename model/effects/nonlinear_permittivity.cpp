#include "model/effects/catalogue.h"

namespace ferrobench::model::effects {

Effect effect_nonlinear_permittivity() {
  return {
      .id = "nonlinear_permittivity",
      .equation = "P += kappa_180 coefficient E^3",
      .family = Family::polarization,
      .parameters = {{"coefficient", "m^2/V^2", 1e-15, 1e-12, Sign::any}},
      .shows = "charge at high field, both signs alike",
      .install = [](std::span<const double> v, Model& model, Ports& ports) {
        const double factor = model.material.permittivity_180 * v[0];
        ports.polarization.emplace_back([factor](double field) { return factor * field * field * field; });
      }};
}

}  // namespace ferrobench::model::effects

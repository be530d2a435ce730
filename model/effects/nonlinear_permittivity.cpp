#include "model/effects/blocks.h"
#include "model/effects/catalogue.h"

namespace ferrobench::model::effects {

Effect effect_nonlinear_permittivity() {
  return {.id = "nonlinear_permittivity",
          .equation = "P += kappa_180 coefficient E^3",
          .family = Family::polarization,
          .parameters = {{"coefficient", "m^2/V^2", 1e-15, 1e-12, Sign::any}},
          .shows = "charge at high field, both signs alike",
          .install = []<class T>(Values<T> v, ModelOf<T>& model, PortsOf<T>& ports) {
            const T factor = model.material.permittivity_180 * v[0];
            ports.polarization.push_back(std::make_unique<ByField<T>>(
                [factor](const T& field) { return factor * field * field * field; }));
          }};
}

}  // namespace ferrobench::model::effects

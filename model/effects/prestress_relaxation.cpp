#include <cmath>

#include "model/effects/catalogue.h"

namespace ferrobench::model::effects {

Effect effect_prestress_relaxation() {
  return {.id = "prestress_relaxation",
          .equation = "sigma_pre(t) = sigma_pre (1 - fraction (1 - exp(-t / time_constant)))",
          .family = Family::equilibrium,
          .parameters = {{"fraction", "1", 5e-3, 0.5, Sign::any},
                         {"time_constant", "s", 0.1, 1e5, Sign::above_zero}},
          .shows = "force foremost, then displacement; falls with time whatever the field does",
          .install = []<class T>(Values<T> v, ModelOf<T>&, PortsOf<T>& ports) {
            ports.prestress_factor = [fraction = v[0], tau = v[1]](const T& t) {
              return 1 + fraction * expm1(-t / tau);
            };
          }};
}

}  // namespace ferrobench::model::effects

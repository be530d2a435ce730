#include "model/effects/blocks.h"
#include "model/effects/catalogue.h"

namespace ferrobench::model::effects {

Effect effect_logarithmic_creep() {
  return {.id = "logarithmic_creep",
          .equation = "S += sum over tau in {0.1, 1, 10, 100, 1000} s of lag_tau(fraction_per_decade S_inst)",
          .family = Family::strain,
          .parameters = {{"fraction_per_decade", "1", 1e-3, 0.1, Sign::any}},
          .shows = "displacement and force in holds, straight against log time",
          .install = []<class T>(Values<T> v, ModelOf<T>&, PortsOf<T>& ports) {
            for (const double tau : {0.1, 1.0, 10.0, 100.0, 1000.0})
              ports.strain.push_back(std::make_unique<DelayedStrain<T>>(
                  tau, [fraction = v[0]](const MaterialState<T>& s) { return fraction * s.instant_strain; }));
          }};
}

}  // namespace ferrobench::model::effects

#include "model/effects/blocks.h"
#include "model/effects/catalogue.h"

namespace ferrobench::model::effects {

Effect effect_viscoelastic_creep() {
  return {.id = "viscoelastic_creep",
          .equation = "S += lag(compliance (sigma - sigma_rest))",
          .family = Family::strain,
          .parameters = {{"compliance", "1/Pa", 1e-13, 1e-11},
                         {"time_constant", "s", 1e-2, 1e4, Sign::above_zero}},
          .shows = "displacement and force after stress has changed; nothing without a spring",
          .install = []<class T>(Values<T> v, ModelOf<T>& model, PortsOf<T>& ports) {
            const T rest = -model.load.prestress;
            ports.strain.push_back(std::make_unique<DelayedStrain<T>>(
                v[1], [compliance = v[0], rest](const MaterialState<T>& s) {
                  return compliance * (s.stress - rest);
                }));
          }};
}

}  // namespace ferrobench::model::effects

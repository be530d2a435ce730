#include "model/effects/blocks.h"
#include "model/effects/catalogue.h"

namespace ferrobench::model::effects {

Effect effect_stress_stabilized_90() {
  return {.id = "stress_stabilized_90",
          .equation = "barrier of 90 -> +/-180 times (1 + coefficient max(0, -sigma_eff))",
          .family = Family::kinetics,
          .parameters = {{"coefficient", "1/Pa", 1e-9, 2e-7}},
          .shows = "all channels; creep after switching and return from 90, more with more prestress",
          .install = []<class T>(Values<T> v, ModelOf<T>& model, PortsOf<T>& ports) {
            refuse_parametrized(model, "stress_stabilized_90");
            ports.stress_stabilization += v[0];
          }};
}

}  // namespace ferrobench::model::effects

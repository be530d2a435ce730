#include "model/effects/catalogue.h"

namespace ferrobench::model::effects {

Effect effect_stage_inertia() {
  return {.id = "stage_inertia",
          .equation =
              "m x'' + c x' + F_spring = -(sigma + sigma_pre) A, c = 2 damping_ratio sqrt((k_s + k_act) m)",
          .family = Family::equilibrium,
          .parameters = {{"mass", "kg", 1e-3, 100, Sign::above_zero},
                         {"damping_ratio", "1", 5e-3, 2, Sign::above_zero}},
          .shows = "displacement and force after corners of the field: ringing, overshoot in fast switching",
          .install = []<class T>(Values<T> v, ModelOf<T>&, PortsOf<T>& ports) {
            ports.inertia = Inertia<T>{.mass = v[0], .damping_ratio = v[1]};
          }};
}

}  // namespace ferrobench::model::effects

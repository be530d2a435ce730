#include "model/effects/blocks.h"
#include "model/effects/catalogue.h"

namespace ferrobench::model::effects {

// From the normal distribution at 0 to the Lorentzian one at 1, which interactions of dilute defects give (Jo
// et al., Phys. Rev. Lett. 99 (2007) 267602).
Effect effect_empirical_tails() {
  return {.id = "empirical_tails",
          .equation =
              "all spreads are those of Student's t with 1 / inverse_freedom degrees of freedom in place of "
              "normal ones; fitted and not physics",
          .family = Family::kinetics,
          .parameters = {{"inverse_freedom", "1", 5e-3, 0.5}},
          .shows = "all channels, switching far before and far after most of it; stands for what has no name",
          .install =
              []<class T>(Values<T> v, ModelOf<T>& model, PortsOf<T>& ports) {
                refuse_parametrized(model, "empirical_tails");
                ports.spread_inverse_freedom += v[0];
              },
          .empirical = true};
}

}  // namespace ferrobench::model::effects

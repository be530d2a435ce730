#include "model/effects/blocks.h"
#include "model/effects/catalogue.h"

namespace ferrobench::model::effects {

// The specimen's polarization may turn around with less of the strain of 90 wells than two steps by 90
// degrees show, whatever the reason.
Effect effect_empirical_direct() {
  return {.id = "empirical_direct",
          .equation =
              "+ <-> - at once: rate_ratio / tau exp(-dg(F) V / (k T)), F = g_+ - g_-, dg0 times "
              "barrier_ratio; fitted and not physics",
          .family = Family::kinetics,
          .parameters = {{"rate_ratio", "1", 1e-3, 1e2}, {"barrier_ratio", "1", 1, 2, Sign::above_zero}},
          .shows = "charge and displacement apart while they switch; stands for what has no name",
          .install =
              []<class T>(Values<T> v, ModelOf<T>& model, PortsOf<T>& ports) {
                refuse_parametrized(model, "empirical_direct");
                ports.direct_rate += v[0];
                ports.direct_barrier = v[1];
              },
          .empirical = true};
}

}  // namespace ferrobench::model::effects

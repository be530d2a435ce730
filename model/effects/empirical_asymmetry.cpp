#include "model/effects/blocks.h"
#include "model/effects/catalogue.h"

namespace ferrobench::model::effects {

// Unequal barriers do not keep the detailed balance; they stand for whatever makes one polarity harder to
// reach than the other.
Effect effect_empirical_asymmetry() {
  return {.id = "empirical_asymmetry",
          .equation =
              "barriers towards + times exp(log_ratio), towards - times exp(-log_ratio); fitted and not "
              "physics",
          .family = Family::kinetics,
          .parameters = {{"log_ratio", "1", 2e-3, 0.5, Sign::any}},
          .shows = "all channels, switching of one polarity before the other; stands for what has no name",
          .install =
              []<class T>(Values<T> v, ModelOf<T>& model, PortsOf<T>& ports) {
                refuse_parametrized(model, "empirical_asymmetry");
                ports.barrier_asymmetry += v[0];
              },
          .empirical = true};
}

}  // namespace ferrobench::model::effects

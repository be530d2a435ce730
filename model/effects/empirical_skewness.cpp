#include "model/effects/blocks.h"
#include "model/effects/catalogue.h"

namespace ferrobench::model::effects {

// The lowest of many barriers is what a region switches over, and such minima are skewed.
Effect effect_empirical_skewness() {
  return {.id = "empirical_skewness",
          .equation =
              "normal scores z of ln(dg0) become (exp(skewness z) - 1) / skewness; fitted and not physics",
          .family = Family::kinetics,
          .parameters = {{"skewness", "1", 1e-2, 2, Sign::any}},
          .shows =
              "all channels, switching that begins slowly and ends at once (below zero), or the other way "
              "round; stands for what has no name",
          .install =
              []<class T>(Values<T> v, ModelOf<T>& model, PortsOf<T>& ports) {
                refuse_parametrized(model, "empirical_skewness");
                ports.spread_skewness += v[0];
              },
          .empirical = true};
}

}  // namespace ferrobench::model::effects

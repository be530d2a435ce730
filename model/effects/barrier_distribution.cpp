#include <cmath>

#include "model/effects/blocks.h"
#include "model/effects/catalogue.h"

namespace ferrobench::model::effects {

// Two independent lognormal spreads make one: their variances add.
Effect effect_barrier_distribution() {
  return {.id = "barrier_distribution",
          .equation = "dg0 lognormal over domains, ln dg0 ~ N(ln barrier, log_std^2)",
          .family = Family::kinetics,
          .parameters = {{"log_std", "1", 0.02, 1.0}},
          .shows = "all channels; switching drawn out over field and time",
          .install =
              []<class T>(Values<T> v, ModelOf<T>& model, PortsOf<T>&) {
                auto& p = domains_of(model, "barrier_distribution");
                p.barrier_log_std = hypot(p.barrier_log_std, v[0]);
              },
          .in_base = [](const Model& m) { return m.polycrystal.barrier_log_std != 0; }};
}

}  // namespace ferrobench::model::effects

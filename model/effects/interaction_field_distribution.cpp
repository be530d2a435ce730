#include <cmath>

#include "model/effects/blocks.h"
#include "model/effects/catalogue.h"

namespace ferrobench::model::effects {

// Two independent normal spreads make one: their variances add.
Effect effect_interaction_field_distribution() {
  return {.id = "interaction_field_distribution",
          .equation = "E_int ~ N(0, std^2) over domains",
          .family = Family::kinetics,
          .parameters = {{"std", "V/m", 5e3, 1e6}},
          .shows = "all channels; switching drawn out over field, the same at each rate",
          .install =
              []<class T>(Values<T> v, ModelOf<T>& model, PortsOf<T>&) {
                auto& p = domains_of(model, "interaction_field_distribution");
                p.interaction_field_std = hypot(p.interaction_field_std, v[0]);
              },
          .in_base = [](const Model& m) { return m.polycrystal.interaction_field_std != 0; }};
}

}  // namespace ferrobench::model::effects

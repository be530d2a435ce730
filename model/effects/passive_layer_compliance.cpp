#include "model/effects/catalogue.h"

namespace ferrobench::model::effects {

// Layers that are there already are in series with the new ones.
Effect effect_passive_layer_compliance() {
  return {.id = "passive_layer_compliance",
          .equation = "k_na (dx_active - x) = F_spring(x): non-active layers in series",
          .family = Family::equilibrium,
          .parameters = {{"stiffness", "N/m", 1e6, 1e10, Sign::off_at_infinity}},
          .shows = "displacement and force with a spring: less of both, at every time",
          .install =
              []<class T>(Values<T> v, ModelOf<T>& model, PortsOf<T>&) {
                auto& stiffness = model.actuator.passive_stiffness;
                stiffness = stiffness ? 1 / (1 / *stiffness + 1 / v[0]) : v[0];
              },
          .in_base = [](const Model& m) { return m.actuator.passive_stiffness.has_value(); }};
}

}  // namespace ferrobench::model::effects

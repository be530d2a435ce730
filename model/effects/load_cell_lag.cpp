#include "model/effects/blocks.h"
#include "model/effects/catalogue.h"

namespace ferrobench::model::effects {

Effect effect_load_cell_lag() {
  return {.id = "load_cell_lag",
          .equation = "Fm = lag(F)",
          .family = Family::force_sensor,
          .parameters = {{"time_constant", "s", 1e-5, 1}},
          .shows = "force on fast ramps and after corners; not in the displacement",
          .install = []<class T>(Values<T> v, ModelOf<T>&, PortsOf<T>& ports) {
            ports.force.push_back(std::make_unique<LagStage<T>>(v[0]));
          }};
}

}  // namespace ferrobench::model::effects

#include "model/effects/blocks.h"
#include "model/effects/catalogue.h"

namespace ferrobench::model::effects {

Effect effect_displacement_lag() {
  return {.id = "displacement_lag",
          .equation = "xm = lag(x)",
          .family = Family::displacement_sensor,
          .parameters = {{"time_constant", "s", 1e-5, 1}},
          .shows = "displacement on fast ramps and after corners; not in the force",
          .install = []<class T>(Values<T> v, ModelOf<T>&, PortsOf<T>& ports) {
            ports.displacement.push_back({SensorOrder::lag, std::make_unique<LagStage<T>>(v[0])});
          }};
}

}  // namespace ferrobench::model::effects

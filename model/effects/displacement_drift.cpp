#include "model/effects/blocks.h"
#include "model/effects/catalogue.h"

namespace ferrobench::model::effects {

Effect effect_displacement_drift() {
  return {.id = "displacement_drift",
          .equation = "xm = x + rate t",
          .family = Family::displacement_sensor,
          .parameters = {{"rate", "m/s", 1e-12, 1e-6, Sign::any}},
          .shows = "displacement, rising straight with time",
          .install = []<class T>(Values<T> v, ModelOf<T>&, PortsOf<T>& ports) {
            ports.displacement.push_back(
                {SensorOrder::crosstalk_and_drift, memoryless<T>([rate = v[0]](const SensorInput<T>& in) {
                   return in.value + rate * in.time;
                 })});
          }};
}

}  // namespace ferrobench::model::effects

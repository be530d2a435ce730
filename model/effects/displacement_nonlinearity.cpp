#include "model/effects/blocks.h"
#include "model/effects/catalogue.h"

namespace ferrobench::model::effects {

Effect effect_displacement_nonlinearity() {
  return {.id = "displacement_nonlinearity",
          .equation = "xm = x (1 + coefficient x)",
          .family = Family::displacement_sensor,
          .parameters = {{"coefficient", "1/m", 1e2, 1e5, Sign::any}},
          .shows = "displacement against force bends",
          .install = []<class T>(Values<T> v, ModelOf<T>&, PortsOf<T>& ports) {
            ports.displacement.push_back(
                {SensorOrder::nonlinearity, memoryless<T>([coefficient = v[0]](const SensorInput<T>& in) {
                   return in.value * (1 + coefficient * in.value);
                 })});
          }};
}

}  // namespace ferrobench::model::effects

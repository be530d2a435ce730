#include "model/effects/blocks.h"
#include "model/effects/catalogue.h"

namespace ferrobench::model::effects {

Effect effect_displacement_crosstalk() {
  return {.id = "displacement_crosstalk",
          .equation = "xm = x + coefficient E_mon",
          .family = Family::displacement_sensor,
          .parameters = {{"coefficient", "m^2/V", 1e-15, 1e-11, Sign::any}},
          .shows = "displacement, in step with the field at the monitor; not in the force",
          .install = []<class T>(Values<T> v, ModelOf<T>&, PortsOf<T>& ports) {
            ports.displacement.push_back({SensorOrder::crosstalk_and_drift,
                                          memoryless<T>([coefficient = v[0]](const SensorInput<T>& in) {
                                            return in.value + coefficient * in.monitor_field;
                                          })});
          }};
}

}  // namespace ferrobench::model::effects

#include "model/effects/blocks.h"
#include "model/effects/catalogue.h"

namespace ferrobench::model::effects {

Effect effect_charge_offset_current() {
  return {.id = "charge_offset_current",
          .equation = "Qm = Q + current t",
          .family = Family::charge_sensor,
          .parameters = {{"current", "A", 1e-10, 1e-5, Sign::any}},
          .shows = "charge, rising straight with time",
          .install = []<class T>(Values<T> v, ModelOf<T>&, PortsOf<T>& ports) {
            ports.charge.push_back(memoryless<T>(
                [current = v[0]](const SensorInput<T>& in) { return in.value + current * in.time; }));
          }};
}

}  // namespace ferrobench::model::effects

#include <algorithm>

#include "model/effects/blocks.h"
#include "model/effects/catalogue.h"

namespace ferrobench::model::effects {

Effect effect_displacement_clipping() {
  return {.id = "displacement_clipping",
          .equation = "xm = clamp(x, -limit, limit)",
          .family = Family::displacement_sensor,
          .parameters = {{"limit", "m", 1e-7, 1e-4, Sign::off_at_infinity, LimitOf::displacement}},
          .shows = "displacement is flat at its ends; not in the force",
          .install = []<class T>(Values<T> v, ModelOf<T>&, PortsOf<T>& ports) {
            ports.displacement.push_back(
                {SensorOrder::clipping, memoryless<T>([limit = v[0]](const SensorInput<T>& in) {
                   return std::clamp<T>(in.value, -limit, limit);
                 })});
          }};
}

}  // namespace ferrobench::model::effects

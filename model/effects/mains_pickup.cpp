#include <cmath>
#include <numbers>

#include "model/effects/blocks.h"
#include "model/effects/catalogue.h"

namespace ferrobench::model::effects {

Effect effect_mains_pickup() {
  return {.id = "mains_pickup",
          .equation = "xm = x + amplitude sin(2 pi frequency t)",
          .family = Family::displacement_sensor,
          .parameters = {{"amplitude", "m", 1e-9, 1e-5, Sign::any}, {"frequency", "Hz", 10, 500}},
          .shows = "displacement, a tone that is there in every segment",
          .install = []<class T>(Values<T> v, ModelOf<T>&, PortsOf<T>& ports) {
            ports.displacement.push_back(
                {SensorOrder::pickup,
                 memoryless<T>([amplitude = v[0], frequency = v[1]](const SensorInput<T>& in) {
                   return in.value + amplitude * sin(2 * std::numbers::pi * frequency * in.time);
                 })});
          }};
}

}  // namespace ferrobench::model::effects

#include "model/effects/catalogue.h"

namespace ferrobench::model::effects {

Effect effect_guide_friction() {
  return {
      .id = "guide_friction",
      .equation = "z' = (sgn(x') - z) |x'| / presliding_distance; force z between actuator and load cell",
      .family = Family::equilibrium,
      .parameters = {{"force", "N", 0.1, 100}, {"presliding_distance", "m", 1e-8, 1e-5, Sign::above_zero}},
      .shows = "displacement after each turning point: sticks, then follows; the same at each rate",
      .install = []<class T>(Values<T> v, ModelOf<T>&, PortsOf<T>& ports) {
        ports.friction = Friction<T>{.force = v[0], .presliding_distance = v[1]};
      }};
}

}  // namespace ferrobench::model::effects

#include "model/effects/catalogue.h"

namespace ferrobench::model::effects {

Effect effect_spring_hardening() {
  return {
      .id = "spring_hardening",
      .equation = "F_spring = k x (1 + coefficient x)",
      .family = Family::equilibrium,
      .parameters = {{"coefficient", "1/m", 1e2, 1e5, Sign::any}},
      .shows = "force against displacement bends; displacement at high field",
      .install = []<class T>(Values<T> v, ModelOf<T>&, PortsOf<T>& ports) {
        ports.spring_hardening.emplace_back([coefficient = v[0]](const T& x) { return 1 + coefficient * x; });
      }};
}

}  // namespace ferrobench::model::effects

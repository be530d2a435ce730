#include <algorithm>

#include "model/effects/catalogue.h"

namespace ferrobench::model::effects {

Effect effect_contact_gap() {
  return {
      .id = "contact_gap",
      .equation = "F_spring = k max(0, x - gap)",
      .family = Family::equilibrium,
      .parameters = {{"gap", "m", 1e-8, 2e-5}},
      .shows = "force and displacement: no force at small displacement, a kink where contact is made",
      .install =
          []<class T>(Values<T> v, ModelOf<T>&, PortsOf<T>& ports) {
            ports.spring_extension.emplace_back([gap = v[0]](const T& x) { return std::max(T(0), x - gap); });
          },
      .fades = false};
}

}  // namespace ferrobench::model::effects

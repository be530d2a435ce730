#include <algorithm>

#include "model/effects/catalogue.h"

namespace ferrobench::model::effects {

Effect effect_contact_gap() {
  return {.id = "contact_gap",
          .equation = "F_spring = k max(0, x - gap)",
          .family = Family::equilibrium,
          .parameters = {{"gap", "m", 1e-8, 2e-5}},
          .shows = "force and displacement: no force at small displacement, a kink where contact is made",
          .install = [](std::span<const double> v, Model&, Ports& ports) {
            ports.spring_extension.emplace_back([gap = v[0]](double x) { return std::max(0.0, x - gap); });
          }};
}

}  // namespace ferrobench::model::effects

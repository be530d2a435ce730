#include "model/effects/catalogue.h"

namespace ferrobench::model::effects {

Effect effect_dielectric_leakage() {
  return {
      .id = "dielectric_leakage",
      .equation = "charge += n A integral E / resistivity dt",
      .family = Family::polarization,
      .parameters = {{"resistivity", "ohm m", 1e6, 1e12, Sign::off_at_infinity}},
      .shows = "charge, in step with the integral of the field: holds at field run away, loops do not close",
      .install = []<class T>(Values<T> v, ModelOf<T>&, PortsOf<T>& ports) {
        ports.conduction.emplace_back([resistivity = v[0]](const T& field) { return field / resistivity; });
      }};
}

}  // namespace ferrobench::model::effects

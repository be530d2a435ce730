#include "model/effects/catalogue.h"

namespace ferrobench::model::effects {

Effect effect_polarization_fatigue() {
  return {
      .id = "polarization_fatigue",
      .equation = "P_+ -> P_+ / (1 + coefficient integral |dP_irr|), the unfatigued P_+ inside the integral",
      .family = Family::polarization,
      .parameters = {{"coefficient", "m^2/C", 1e-4, 0.5}},
      .shows = "charge foremost, then all channels; loops shrink from cycle to cycle",
      .install = []<class T>(Values<T> v, ModelOf<T>&, PortsOf<T>& ports) { ports.fatigue += v[0]; }};
}

}  // namespace ferrobench::model::effects

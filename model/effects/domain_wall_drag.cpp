#include "model/effects/catalogue.h"

namespace ferrobench::model::effects {

Effect effect_domain_wall_drag() {
  EffectParameter coefficient{"coefficient", "V s m/C", 1e2, 1e6};
  coefficient.times_polarization = true;
  return {.id = "domain_wall_drag",
          .equation = "rates see E - coefficient dP_irr/dt, P_irr = P_+ (x+ - x-)",
          .family = Family::kinetics,
          .parameters = {coefficient},
          .shows = "all channels; fast switching comes later and is spread out, slow switching is not",
          .install = []<class T>(Values<T> v, ModelOf<T>&, PortsOf<T>& ports) {
            ports.domain_wall_drag += v[0];
          }};
}

}  // namespace ferrobench::model::effects

#include "model/effects/catalogue.h"

namespace ferrobench::model::effects {

Effect effect_source_resistance() {
  return {
      .id = "source_resistance",
      .equation = "E = E_mon - coefficient dP/dt",
      .family = Family::drive,
      .parameters = {{"coefficient", "V s m/C", 1e2, 1e6}},
      .shows = "all channels but the field; switching late at high rates, and slowed down by its own current",
      .install = []<class T>(Values<T> v, ModelOf<T>&, PortsOf<T>& ports) {
        ports.source_resistance += v[0];
      }};
}

}  // namespace ferrobench::model::effects

#include "model/effects/blocks.h"
#include "model/effects/catalogue.h"

namespace ferrobench::model::effects {

Effect effect_internal_bias_field() {
  return {
      .id = "internal_bias_field",
      .equation = "E_int = field in every domain (imprint)",
      .family = Family::kinetics,
      .parameters = {{"field", "V/m", 5e3, 1e6, Sign::any}},
      .shows = "all channels; loops shifted along the field",
      .install = []<class T>(Values<T> v, ModelOf<T>& model,
                             PortsOf<T>&) { domains_of(model, "internal_bias_field").bias_field += v[0]; },
      .in_base = [](const Model& m) { return m.polycrystal.bias_field != 0; }};
}

}  // namespace ferrobench::model::effects

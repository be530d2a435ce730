#include "model/effects/empirical.h"

namespace ferrobench::model::effects {

// ln(rate) is nearly linear in the driving force, so that u is a factor on the rates. A shift of the field
// that is the same always has a name, internal_bias_field, and is not in u.
Effect effect_empirical_rate() {
  return {.id = "empirical_rate",
          .equation =
              "rates see E + u, an empirical table of field, fractions and their past (empirical.h), "
              "fitted and not physics",
          .family = Family::kinetics,
          .parameters = empirical_parameters({"amplitude", "V/m", 1e3, 1e6}),
          .shows = "all channels, where domains switch; stands for what has no name",
          .install =
              []<class T>(Values<T> v, ModelOf<T>&, PortsOf<T>& ports) {
                ports.seen_by_rates.push_back(std::make_unique<EmpiricalTerm<T>>(v, Rest::poled));
              },
          .empirical = true,
          .table = true};
}

}  // namespace ferrobench::model::effects

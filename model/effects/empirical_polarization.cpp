#include "model/effects/empirical.h"

namespace ferrobench::model::effects {

Effect effect_empirical_polarization() {
  return {.id = "empirical_polarization",
          .equation =
              "P += u, an empirical table of field, fractions and their past (empirical.h), fitted and "
              "not physics",
          .family = Family::polarization,
          .parameters = empirical_parameters({"amplitude", "C/m^2", 1e-4, 1e-1}),
          .shows = "charge; stands for what has no name",
          .install =
              []<class T>(Values<T> v, ModelOf<T>&, PortsOf<T>& ports) {
                ports.polarization.push_back(std::make_unique<EmpiricalTerm<T>>(v, Rest::at_start));
              },
          .empirical = true,
          .table = true};
}

}  // namespace ferrobench::model::effects

#include "model/effects/empirical.h"

namespace ferrobench::model::effects {

Effect effect_empirical_strain() {
  return {.id = "empirical_strain",
          .equation =
              "S += u, an empirical table of field, fractions and their past (empirical.h), fitted and "
              "not physics",
          .family = Family::strain,
          .parameters = empirical_parameters({"amplitude", "1", 1e-6, 1e-3}),
          .shows = "displacement and force; stands for what has no name",
          .install =
              []<class T>(Values<T> v, ModelOf<T>&, PortsOf<T>& ports) {
                ports.strain.push_back(std::make_unique<EmpiricalTerm<T>>(v, Rest::at_start));
              },
          .empirical = true,
          .table = true};
}

}  // namespace ferrobench::model::effects

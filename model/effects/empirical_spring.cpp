#include "model/effects/empirical.h"

namespace ferrobench::model::effects {
namespace {

template <class T>
class EmpiricalSpring final : public SpringTerm<T> {
 public:
  explicit EmpiricalSpring(Values<T> values) : added_(values) {}
  void start() override { added_.start(); }
  T propose(const T& extension) const override { return added_.propose(extension); }
  void accept(const T& extension) override { added_.accept(extension); }

 private:
  EmpiricalOperator<T> added_;
};

}  // namespace

// Without an amplitude nothing is plugged in, so that a linear spring keeps its closed form.
Effect effect_empirical_spring() {
  return {.id = "empirical_spring",
          .equation =
              "F_spring = k (x + u), an empirical table of the extension and its past (empirical.h), "
              "fitted and not physics",
          .family = Family::equilibrium,
          .parameters =
              empirical_parameters({"amplitude", "m", 1e-9, 1e-5},
                                   {"extension_scale", "m", 1e-6, 1e-3, Sign::above_zero}, extension_table),
          .shows = "force against displacement; the same at each rate; stands for what has no name",
          .install =
              []<class T>(Values<T> v, ModelOf<T>&, PortsOf<T>& ports) {
                if (!vanishes(v[0])) ports.spring.push_back(std::make_unique<EmpiricalSpring<T>>(v));
              },
          .empirical = true,
          .table = true};
}

}  // namespace ferrobench::model::effects

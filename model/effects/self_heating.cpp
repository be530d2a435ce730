#include <algorithm>
#include <cmath>

#include "model/effects/catalogue.h"
#include "model/physics/lag.h"

namespace ferrobench::model::effects {
namespace {

// Mean of max(0, e) for e that goes linearly from a to b.
template <class T>
T mean_positive(T a, T b) {
  if (a > b) std::swap(a, b);
  if (a >= 0) return 0.5 * (a + b);
  return b <= 0 ? T(0) : 0.5 * b * b / (b - a);
}

template <class T>
class SelfHeating final : public MaterialTerm<T> {
 public:
  SelfHeating(T gain, T tau) : gain_(gain), tau_(tau) {}
  void start(const MaterialState<T>& at) override {
    value_ = 0;
    last_ = at;
  }
  T propose(const T& h, const MaterialState<T>& end) const override {
    if (h <= 0) return value_;
    const T change = end.switched_polarization - last_.switched_polarization;
    const double sign = change < 0 ? -1 : 1;
    const T rise = gain_ * abs(change) * mean_positive<T>(sign * last_.field, sign * end.field);
    // A source that is even over the step: its lag holds the share that has not decayed by the end.
    return lag(value_, tau_ * rise / h, tau_ * rise / h, h, tau_);
  }
  void accept(const T& h, const MaterialState<T>& end) override {
    value_ = propose(h, end);
    last_ = end;
  }

 private:
  T gain_, tau_;
  T value_ = 0;
  MaterialState<T> last_;
};

}  // namespace

Effect effect_self_heating() {
  return {.id = "self_heating",
          .equation = "S += T; T' = strain_per_energy_density max(0, E dP_irr/dt) - T / time_constant",
          .family = Family::strain,
          .parameters = {{"strain_per_energy_density", "m^3/J", 1e-12, 1e-9, Sign::any},
                         {"time_constant", "s", 0.1, 1e4, Sign::above_zero}},
          .shows = "displacement and force, growing from loop to loop and going back in rests",
          .install = []<class T>(Values<T> v, ModelOf<T>&, PortsOf<T>& ports) {
            ports.strain.push_back(std::make_unique<SelfHeating<T>>(v[0], v[1]));
          }};
}

}  // namespace ferrobench::model::effects

#include <algorithm>
#include <cmath>

#include "model/effects/catalogue.h"
#include "model/physics/lag.h"

namespace ferrobench::model::effects {
namespace {

// Mean of max(0, e) for e that goes linearly from a to b.
double mean_positive(double a, double b) {
  if (a > b) std::swap(a, b);
  if (a >= 0) return 0.5 * (a + b);
  return b <= 0 ? 0 : 0.5 * b * b / (b - a);
}

class SelfHeating final : public StrainTerm {
 public:
  SelfHeating(double gain, double tau) : gain_(gain), tau_(tau) {}
  void start(const MaterialState& at) override {
    value_ = 0;
    last_ = at;
  }
  double propose(double h, const MaterialState& end) const override {
    if (h <= 0) return value_;
    const double change = end.switched_polarization - last_.switched_polarization;
    const double sign = change < 0 ? -1 : 1;
    const double rise = gain_ * std::abs(change) * mean_positive(sign * last_.field, sign * end.field);
    // A source that is even over the step: its lag holds the share that has not decayed by the end.
    return lag(value_, tau_ * rise / h, tau_ * rise / h, h, tau_);
  }
  void accept(double h, const MaterialState& end) override {
    value_ = propose(h, end);
    last_ = end;
  }

 private:
  double gain_, tau_;
  double value_ = 0;
  MaterialState last_;
};

}  // namespace

Effect effect_self_heating() {
  return {.id = "self_heating",
          .equation = "S += T; T' = strain_per_energy_density max(0, E dP_irr/dt) - T / time_constant",
          .family = Family::strain,
          .parameters = {{"strain_per_energy_density", "m^3/J", 1e-12, 1e-9, Sign::any},
                         {"time_constant", "s", 0.1, 1e4, Sign::above_zero}},
          .shows = "displacement and force, growing from loop to loop and going back in rests",
          .install = [](std::span<const double> v, Model&, Ports& ports) {
            ports.strain.push_back(std::make_unique<SelfHeating>(v[0], v[1]));
          }};
}

}  // namespace ferrobench::model::effects

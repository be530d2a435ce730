#include <cmath>

#include "model/effects/catalogue.h"

namespace ferrobench::model::effects {
namespace {

// Exact for a charge that goes linearly between updates.
class Decay final : public SensorStage {
 public:
  explicit Decay(double tau) : tau_(tau) {}
  void start(const SensorInput& in) override {
    last_ = in;
    value_ = in.value;
  }
  double update(const SensorInput& in) override {
    const double h = in.time - last_.time, z = h / tau_;
    if (h > 0) value_ = value_ * std::exp(-z) - (in.value - last_.value) * std::expm1(-z) / z;
    last_ = in;
    return value_;
  }

 private:
  double tau_;
  SensorInput last_;
  double value_ = 0;
};

}  // namespace

Effect effect_charge_amplifier_decay() {
  return {.id = "charge_amplifier_decay",
          .equation = "Qm' = Q' - Qm / time_constant",
          .family = Family::charge_sensor,
          .parameters = {{"time_constant", "s", 1, 1e5, Sign::off_at_infinity}},
          .shows = "charge falls towards zero in every hold, from either side",
          .install = [](std::span<const double> v, Model&, Ports& ports) {
            ports.charge.push_back(std::make_unique<Decay>(v[0]));
          }};
}

}  // namespace ferrobench::model::effects

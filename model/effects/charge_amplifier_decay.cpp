#include <cmath>

#include "model/effects/catalogue.h"

namespace ferrobench::model::effects {
namespace {

// Exact for a charge that goes linearly between updates.
template <class T>
class Decay final : public SensorStage<T> {
 public:
  explicit Decay(T tau) : tau_(tau) {}
  void start(const SensorInput<T>& in) override {
    last_ = in;
    value_ = in.value;
  }
  T update(const SensorInput<T>& in) override {
    const T h = in.time - last_.time, z = h / tau_;
    if (h > 0) value_ = value_ * exp(-z) - (in.value - last_.value) * expm1(-z) / z;
    last_ = in;
    return value_;
  }

 private:
  T tau_;
  SensorInput<T> last_;
  T value_ = 0;
};

}  // namespace

Effect effect_charge_amplifier_decay() {
  return {.id = "charge_amplifier_decay",
          .equation = "Qm' = Q' - Qm / time_constant",
          .family = Family::charge_sensor,
          .parameters = {{"time_constant", "s", 1, 1e5, Sign::off_at_infinity}},
          .shows = "charge falls towards zero in every hold, from either side",
          .install = []<class T>(Values<T> v, ModelOf<T>&, PortsOf<T>& ports) {
            ports.charge.push_back(std::make_unique<Decay<T>>(v[0]));
          }};
}

}  // namespace ferrobench::model::effects

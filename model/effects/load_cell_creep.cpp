#include "model/effects/catalogue.h"
#include "model/physics/lag.h"

namespace ferrobench::model::effects {
namespace {

template <class T>
class LoadCellCreep final : public SensorStage<T> {
 public:
  LoadCellCreep(T fraction, T tau, T rest) : fraction_(fraction), tau_(tau), rest_(rest) {}
  void start(const SensorInput<T>& in) override {
    last_ = in;
    crept_ = 0;
  }
  T update(const SensorInput<T>& in) override {
    crept_ = lag<T>(crept_, last_.value - rest_, in.value - rest_, in.time - last_.time, tau_);
    last_ = in;
    return in.value + fraction_ * crept_;
  }

 private:
  T fraction_, tau_, rest_;
  SensorInput<T> last_;
  T crept_ = 0;
};

}  // namespace

Effect effect_load_cell_creep() {
  return {.id = "load_cell_creep",
          .equation = "Fm = F + fraction lag(F - F_rest), F_rest = sigma_pre A",
          .family = Family::force_sensor,
          .parameters = {{"fraction", "1", 1e-4, 0.1, Sign::any},
                         {"time_constant", "s", 0.1, 1e4, Sign::above_zero}},
          .shows = "force in holds under load; not in the displacement",
          .install = []<class T>(Values<T> v, ModelOf<T>& model, PortsOf<T>& ports) {
            const T rest = model.load.prestress * model.actuator.area;
            ports.force.push_back(std::make_unique<LoadCellCreep<T>>(v[0], v[1], rest));
          }};
}

}  // namespace ferrobench::model::effects

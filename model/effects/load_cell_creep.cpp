#include "model/effects/catalogue.h"
#include "model/physics/lag.h"

namespace ferrobench::model::effects {
namespace {

class LoadCellCreep final : public SensorStage {
 public:
  LoadCellCreep(double fraction, double tau, double rest) : fraction_(fraction), tau_(tau), rest_(rest) {}
  void start(const SensorInput& in) override {
    last_ = in;
    crept_ = 0;
  }
  double update(const SensorInput& in) override {
    crept_ = lag(crept_, last_.value - rest_, in.value - rest_, in.time - last_.time, tau_);
    last_ = in;
    return in.value + fraction_ * crept_;
  }

 private:
  double fraction_, tau_, rest_;
  SensorInput last_;
  double crept_ = 0;
};

}  // namespace

Effect effect_load_cell_creep() {
  return {.id = "load_cell_creep",
          .equation = "Fm = F + fraction lag(F - F_rest), F_rest = sigma_pre A",
          .family = Family::force_sensor,
          .parameters = {{"fraction", "1", 1e-4, 0.1, Sign::any},
                         {"time_constant", "s", 0.1, 1e4, Sign::above_zero}},
          .shows = "force in holds under load; not in the displacement",
          .install = [](std::span<const double> v, Model& model, Ports& ports) {
            const double rest = model.load.prestress * model.actuator.area;
            ports.force.push_back(std::make_unique<LoadCellCreep>(v[0], v[1], rest));
          }};
}

}  // namespace ferrobench::model::effects

#include "model/effects/catalogue.h"

namespace ferrobench::model::effects {
namespace {

class Electrostriction final : public StrainTerm {
 public:
  explicit Electrostriction(double coefficient) : coefficient_(coefficient) {}
  bool instant() const override { return true; }
  void start(const MaterialState&) override {}
  double propose(double, const MaterialState& end) const override {
    return coefficient_ * end.field * end.field;
  }
  void accept(double, const MaterialState&) override {}

 private:
  double coefficient_;
};

}  // namespace

Effect effect_electrostriction() {
  return {.id = "electrostriction",
          .equation = "S += coefficient E^2",
          .family = Family::strain,
          .parameters = {{"coefficient", "m^2/V^2", 1e-18, 1e-15, Sign::any}},
          .shows = "displacement and force at high field, both signs alike",
          .install = [](std::span<const double> v, Model&, Ports& ports) {
            ports.strain.push_back(std::make_unique<Electrostriction>(v[0]));
          }};
}

}  // namespace ferrobench::model::effects

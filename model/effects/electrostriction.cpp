#include "model/effects/catalogue.h"

namespace ferrobench::model::effects {
namespace {

template <class T>
class Electrostriction final : public MaterialTerm<T> {
 public:
  explicit Electrostriction(T coefficient) : coefficient_(coefficient) {}
  bool instant() const override { return true; }
  void start(const MaterialState<T>&) override {}
  T propose(const T&, const MaterialState<T>& end) const override {
    return coefficient_ * end.field * end.field;
  }
  void accept(const T&, const MaterialState<T>&) override {}

 private:
  T coefficient_;
};

}  // namespace

Effect effect_electrostriction() {
  return {.id = "electrostriction",
          .equation = "S += coefficient E^2",
          .family = Family::strain,
          .parameters = {{"coefficient", "m^2/V^2", 1e-18, 1e-15, Sign::any}},
          .shows = "displacement and force at high field, both signs alike",
          .install = []<class T>(Values<T> v, ModelOf<T>&, PortsOf<T>& ports) {
            ports.strain.push_back(std::make_unique<Electrostriction<T>>(v[0]));
          }};
}

}  // namespace ferrobench::model::effects

#include "model/effects/catalogue.h"

namespace ferrobench::model::effects {
namespace {

// Weiss's molecular field of a ferroelectric (for example R. C. Smith and Z. Ounaies, J. Intell. Mater. Syst.
// Struct. 11 (2000) 62, equation of the effective field E + alpha P). What counts of P here is its switched
// part: the rest follows the field and only scales it.
template <class T>
class MeanField final : public MaterialTerm<T> {
 public:
  explicit MeanField(T coefficient) : coefficient_(coefficient) {}
  bool instant() const override { return true; }
  bool by_stress() const override { return false; }
  void start(const MaterialState<T>&) override {}
  T propose(const T&, const MaterialState<T>& end) const override {
    return coefficient_ * end.switched_polarization;
  }
  void accept(const T&, const MaterialState<T>&) override {}

 private:
  T coefficient_;
};

}  // namespace

Effect effect_mean_field_interaction() {
  EffectParameter coefficient{"coefficient", "V m/C", 1e4, 3e6, Sign::any};
  coefficient.times_polarization = true;
  return {
      .id = "mean_field_interaction",
      .equation = "rates see E + coefficient P_irr, P_irr = P_+ (x+ - x-)",
      .family = Family::kinetics,
      .parameters = {coefficient},
      .shows = "all channels; switching begins late and ends steeply (above zero) or is spread out (below)",
      .install = []<class T>(Values<T> v, ModelOf<T>&, PortsOf<T>& ports) {
        ports.seen_by_rates.push_back(std::make_unique<MeanField<T>>(v[0]));
      }};
}

}  // namespace ferrobench::model::effects

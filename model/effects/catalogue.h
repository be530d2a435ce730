// The catalogue of effects: terms that the base model lacks. One file each; the build collects them.
//
// A file model/effects/<id>.cpp defines `Effect effect_<id>()` in namespace ferrobench::model::effects. Off
// means exactly the base model: an effect that is not listed in a model file is never asked anything.
#pragma once

#include <functional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "model/model.h"
#include "model/physics/implicit.h"
#include "model/physics/ports.h"

namespace ferrobench::model {

// The family that a report names when the member cannot be told.
enum class Family {
  kinetics,
  strain,
  polarization,
  equilibrium,
  drive,
  charge_sensor,
  displacement_sensor,
  force_sensor
};
std::string_view family_name(Family family);
bool is_sensor(Family family);

// off_at_infinity: above zero, and the effect fades as the value grows (a resistivity, a limit).
enum class Sign { not_negative, above_zero, off_at_infinity, any };

// Below its limit such an effect does nothing at all, so a search begins at what was reached.
enum class LimitOf { nothing, displacement, field_rate };

struct EffectParameter {
  EffectParameter(std::string_view its_name, std::string_view its_unit, double from, double to,
                  Sign sign = Sign::not_negative, LimitOf what = LimitOf::nothing)
      : name(its_name),
        unit(its_unit),
        low(from),
        high(to),
        any_sign(sign == Sign::any),
        above_zero(sign == Sign::above_zero || sign == Sign::off_at_infinity),
        off_at_infinity(sign == Sign::off_at_infinity),
        limit_of(what) {}
  std::string_view name;
  std::string_view unit;
  double low = 0, high = 0;  // plausible range
  bool any_sign = false;     // the range holds for the magnitude
  bool above_zero = false;   // zero has no meaning
  bool off_at_infinity = false;
  LimitOf limit_of = LimitOf::nothing;
  bool times_polarization = false;  // all that it does goes by its product with the remanent polarization
};

template <class T>
using Values = std::span<const T>;

// Plugs an effect in; values in the order of its parameters. The model may be changed where the effect is a
// base parameter that was absent. Made from one function for any type T of numbers,
//
//     []<class T>(Values<T> values, ModelOf<T>& model, PortsOf<T>& ports) { ... }
class Install {
 public:
  Install() = default;
  template <class Function>
  Install(Function function) : plain_(function), with_tangents_(function) {}  // NOLINT: it is that function
  void operator()(Values<double> values, Model& model, Ports& ports) const { plain_(values, model, ports); }
  void operator()(Values<DualNumber> values, ModelOf<DualNumber>& model, PortsOf<DualNumber>& ports) const {
    with_tangents_(values, model, ports);
  }

 private:
  std::function<void(Values<double>, Model&, Ports&)> plain_;
  std::function<void(Values<DualNumber>, ModelOf<DualNumber>&, PortsOf<DualNumber>&)> with_tangents_;
};

struct Effect {
  std::string_view id;
  std::string_view equation;  // plain text
  Family family = Family::kinetics;
  // The first is the amplitude: where it fades, so does the effect, unless `fades` says no. The others are
  // its shape.
  std::vector<EffectParameter> parameters;
  std::string_view shows;  // channels and segments in which it is seen
  Install install;
  // Where it is a base parameter: whether a model has that already. Such an effect is recalibrated, not
  // found.
  std::function<bool(const Model& model)> in_base{};
  // Stands for what has no name: fitted, not physics. A model may hold it, but it is never among what a
  // discrepancy is called.
  bool empirical = false;
  // An empirical term that is linear in its weights (effects/empirical.h); the others correct the kinetics by
  // a few numbers and are fitted as effects are.
  bool table = false;
  // False where an amplitude of next to nothing is not the base model: a spring that only pushes is another
  // one at any gap.
  bool fades = true;
};

// All effects, by id.
std::span<const Effect> effect_catalogue();
// Error(bad_model) with the nearest id.
const Effect& find_effect(std::string_view id);

// What is wrong with the settings of a model file: unknown ids, missing, unknown or impossible parameters, an
// id twice.
std::vector<Problem> check_effects(const std::vector<EffectSetting>& settings, const std::string& path);
// Plugs all of them in, by id: the order in which a model file lists them does not matter.
template <class T>
void install_effects(ModelOf<T>& model, PortsOf<T>& ports);

}  // namespace ferrobench::model

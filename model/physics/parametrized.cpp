#include "model/physics/parametrized.h"

#include <cmath>

#include "model/physics/barrier.h"

namespace ferrobench::model {
namespace {

template <class T>
T mean_exp(const T& a, const T& b) {
  const T change = b - a;
  return abs(change) < 1e-6 ? exp(0.5 * (a + b)) : (exp(b) - exp(a)) / change;
}

// force_at with the slope of the branch's line.
double force_on(std::span<const CriticalForcePoint> branch, double fraction) {
  return force_at(branch, fraction);
}
DualNumber force_on(std::span<const CriticalForcePoint> branch, const DualNumber& fraction) {
  constexpr double reach = 1e-7;  // within a line's rounding, far below the distance of points
  const double slope =
      (force_at(branch, fraction.value + reach) - force_at(branch, fraction.value - reach)) / (2 * reach);
  return fraction.chain(force_at(branch, fraction.value), slope);
}

}  // namespace

Parametrized::Parametrized(const Model& model, const KineticConstants& constants) : law_(model, constants) {}

template <class T>
typename ParametrizedLaw<T>::Rates ParametrizedLaw<T>::rates(const LoadsOf<T>& at, const T& plus) const {
  const T force = driving_forces(constants, at).plus_90;
  const T out = force + 4 * barrier - force_on(critical.unload, plus) - shift;
  const T back = -force + 4 * barrier + force_on(critical.load, plus) + shift;
  return {-constants.inverse_energy * barrier_equal_curvature(out, barrier),
          -constants.inverse_energy * barrier_equal_curvature(back, barrier)};
}

template <class T>
T ParametrizedLaw<T>::slope(const Rates& r, const T& plus) const {
  return ((1 - plus) * exp(r.log_back) - plus * exp(r.log_out)) / constants.relaxation_time;
}

template <class T>
T ParametrizedLaw<T>::miss(const T& h, const Rates& from, const T& plus, const LoadsOf<T>& to,
                           const T& end) const {
  const T span = h / constants.relaxation_time;
  const Rates r = rates(to, end);
  const T out = span * mean_exp(from.log_out, r.log_out), back = span * mean_exp(from.log_back, r.log_back);
  const T total = out + back;
  if (total <= 0) return plus - end;
  const T kept = exp(-total);
  return plus * kept + back * (-expm1(-total) / total) - end;
}

template struct ParametrizedLaw<double>;
template struct ParametrizedLaw<DualNumber>;

// The end of a step whose rates depend on the end: a root in [0, 1], by bisection refined with the secant
// (Illinois).
double Parametrized::step(double h, const ParametrizedLaw<double>::Rates& from, double plus,
                          const Loads& to) const {
  const auto miss = [&](double end) { return law_.miss(h, from, plus, to, end); };
  double low = 0, high = 1, at_low = miss(low), at_high = miss(high);
  if (at_low <= 0) return low;
  if (at_high >= 0) return high;
  int side = 0;
  for (int i = 0; i < 200 && high - low > 1e-14; ++i) {
    const double middle =
        (i % 8 == 7) ? 0.5 * (low + high) : (low * at_high - high * at_low) / (at_high - at_low);
    const double at = miss(middle);
    if (at == 0) return middle;
    if (at > 0) {
      low = middle;
      at_low = at;
      if (side == 1) at_high *= 0.5;
      side = 1;
    } else {
      high = middle;
      at_high = at;
      if (side == -1) at_low *= 0.5;
      side = -1;
    }
  }
  return 0.5 * (low + high);
}

void Parametrized::start(const Loads& at, const Fractions& fractions) {
  if (fractions.plus != 1)
    throw Error(ErrorCode::bad_model,
                "a parametrized polycrystal is never reversed: it starts poled towards +",
                Problem{.path = "/polycrystal/method",
                        .message = "knows no specimen that is poled towards - or not at all",
                        .given = "parametrized",
                        .allowed = {"none", "distribution"}});
  at_ = at;
  means_ = {};
  means_.plus_rate = law_.slope(law_.rates(at, 1), 1);
}

const Means& Parametrized::propose(double h, const Loads& at, const Loads&) {
  proposed_at_ = at;
  ++steps_;
  proposed_ = {};
  proposed_.plus = step(h, law_.rates(at_, means_.plus), means_.plus, at);
  proposed_.plus_rate = law_.slope(law_.rates(at, proposed_.plus), proposed_.plus);
  return proposed_;
}

void Parametrized::accept() {
  at_ = proposed_at_;
  means_ = proposed_;
}

}  // namespace ferrobench::model

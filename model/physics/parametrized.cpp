#include "model/physics/parametrized.h"

#include <cmath>

#include "model/physics/barrier.h"

namespace ferrobench::model {
namespace {

double mean_exp(double a, double b) {
  const double change = b - a;
  return std::abs(change) < 1e-6 ? std::exp(0.5 * (a + b)) : (std::exp(b) - std::exp(a)) / change;
}

}  // namespace

Parametrized::Parametrized(const Model& model, const KineticConstants& constants)
    : constants_(constants),
      barrier_(model.material.barrier),
      critical_(model.polycrystal.critical_force.value()),
      shift_(critical_.prestress_shift * (model.load.prestress - critical_.prestress)) {}

Parametrized::Rates Parametrized::rates(const Loads& at, double plus) const {
  const double force = driving_forces(constants_, at).plus_90;
  const double out = force + 4 * barrier_ - force_at(critical_.unload, plus) - shift_;
  const double back = -force + 4 * barrier_ + force_at(critical_.load, plus) + shift_;
  return {-constants_.inverse_energy * barrier_equal_curvature(out, barrier_),
          -constants_.inverse_energy * barrier_equal_curvature(back, barrier_)};
}

double Parametrized::slope(const Rates& r, double plus) const {
  return ((1 - plus) * std::exp(r.log_back) - plus * std::exp(r.log_out)) / constants_.relaxation_time;
}

// The end of a step whose rates depend on the end: a root in [0, 1], by bisection refined with the secant
// (Illinois).
double Parametrized::step(double h, const Rates& from, double plus, const Loads& to) const {
  const double span = h / constants_.relaxation_time;
  const auto miss = [&](double end) {
    const Rates r = rates(to, end);
    const double out = span * mean_exp(from.log_out, r.log_out),
                 back = span * mean_exp(from.log_back, r.log_back);
    const double total = out + back;
    if (total <= 0) return plus - end;
    const double kept = std::exp(-total);
    return plus * kept + back * (-std::expm1(-total) / total) - end;
  };
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

void Parametrized::start(const Loads& at) {
  at_ = at;
  means_ = {};
  means_.plus_rate = slope(rates(at, 1), 1);
}

const Means& Parametrized::propose(double h, const Loads& at, const Loads&) {
  proposed_at_ = at;
  ++steps_;
  proposed_ = {};
  proposed_.plus = step(h, rates(at_, means_.plus), means_.plus, at);
  proposed_.plus_rate = slope(rates(at, proposed_.plus), proposed_.plus);
  return proposed_;
}

void Parametrized::accept() {
  at_ = proposed_at_;
  means_ = proposed_;
}

}  // namespace ferrobench::model

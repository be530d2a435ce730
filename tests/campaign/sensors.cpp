#include "tests/campaign/sensors.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace ferrobench::campaign {

double low_pass(double y, double u0, double u1, double h, double tau) {
  if (h <= 0) return y;
  if (tau <= 0) return u1;
  // The ramp's own lag is slope * tau behind; what is left of the start decays.
  const double slope = (u1 - u0) / h, behind = slope * tau;
  if (h < 1e-6 * tau) return y + (0.5 * (u0 + u1) - y) * h / tau;
  return u1 - behind + (y - u0 + behind) * std::exp(-h / tau);
}

double Sensors::charge(double h, double q) {
  if (!started_) {
    first_charge_ = integrated_ = q;
  } else if (t_.charge_decay) {
    // The integrator loses Qm / tau and gains Q': with u = tau Q', a lag towards u.
    const double gain = h > 0 ? (q - last_.charge) / h * *t_.charge_decay : 0;
    integrated_ = low_pass(integrated_, gain, gain, h, *t_.charge_decay);
  } else {
    integrated_ += q - last_.charge;
  }
  absorbed_ = low_pass(absorbed_, last_.charge - first_charge_, q - first_charge_, h, t_.absorption_time);
  const double total = integrated_ + t_.offset_current * (last_time_ + h) + t_.absorption * absorbed_;
  return total * (1 - t_.charge_compression * total * total);
}

double Sensors::displacement(double time, double h, double x, double field) {
  const double seen = x * (1 + t_.nonlinearity * x) + t_.crosstalk * field + t_.drift * time;
  lagged_ = started_ ? low_pass(lagged_, before_lag_, seen, h, t_.displacement_lag) : seen;
  before_lag_ = seen;
  double out = lagged_ + t_.pickup * std::sin(2 * std::numbers::pi * t_.pickup_frequency * time);
  if (t_.delay > 0) {
    history_.emplace_back(time, out);
    const double then = time - t_.delay;
    while (history_.size() > 1 && history_[1].first <= then) history_.pop_front();
    const auto [t0, x0] = history_.front();
    out = x0;
    if (then > t0 && history_.size() > 1)
      out += (history_[1].second - x0) * (then - t0) / (history_[1].first - t0);
  }
  played_ = started_ ? std::clamp(played_, out - t_.play, out + t_.play) : out;
  return t_.limit ? std::clamp(played_, -*t_.limit, *t_.limit) : played_;
}

double Sensors::force(double h, double f, double field) {
  crept_ = low_pass(crept_, last_.force - rest_force_, f - rest_force_, h, t_.cell_creep_time);
  const double crept = f + t_.cell_creep * crept_;
  cell_ = started_ ? low_pass(cell_, before_cell_lag_, crept, h, t_.cell_lag) : crept;
  before_cell_lag_ = crept;
  return cell_ + t_.cell_crosstalk * field;
}

Seen Sensors::look(double time, const Seen& truth) {
  if (!started_) {
    last_ = truth;
    last_time_ = time;
  }
  const double h = time - last_time_;
  const Seen out{truth.field, charge(h, truth.charge), displacement(time, h, truth.displacement, truth.field),
                 force(h, truth.force, truth.field)};
  started_ = true;
  last_ = truth;
  last_time_ = time;
  return out;
}

}  // namespace ferrobench::campaign

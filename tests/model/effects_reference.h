// The model once more, as plainly as can be: tiny explicit steps, every effect as its formula stands in the
// catalogue. Slow, first order, and sharing no code with the simulator.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <map>
#include <numbers>
#include <numeric>
#include <string_view>

#include "tests/model/effects_support.h"
#include "tests/model/empirical_reference.h"
#include "tests/model/student_quantiles.h"

namespace ferrobench::model {

class Reference {
 public:
  struct Domain {
    double barrier, field, weight, plus = 1, minus = 0;
  };

  Reference(Model m, const std::map<std::string, double>& parameters)
      : m_(std::move(m)), p_(parameters.begin(), parameters.end()) {
    for (const auto* id : {"empirical_strain", "empirical_polarization", "empirical_rate", "empirical_drive",
                           "empirical_spring"})
      empirical_.emplace(id, PlainTerm(parameters, id));
    domains_ = {{m_.material.barrier, of("internal_bias_field.field"), 1}};
    const double log_std = of("barrier_distribution.log_std"), std = of("interaction_field_distribution.std");
    if (log_std == 0 && std == 0) return;
    domains_.clear();
    constexpr int n = 240;
    double total = 0;
    for (int i = 0; i < n; ++i) {
      const double z = -4.5 + 9.0 * (i + 0.5) / n, w = std::exp(-0.5 * z * z);
      const double skewness = of("empirical_skewness.skewness");
      const double tail = has("empirical_tails.inverse_freedom") ? student_of_four(z) / z : 1;
      const double skewed = skewness == 0 ? z : (std::exp(skewness * z) - 1) / skewness;
      domains_.push_back({m_.material.barrier * std::exp(log_std * tail * skewed), std * tail * z, w});
      total += w;
    }
    for (auto& d : domains_) d.weight /= total;
  }

  Trajectory play(const Program& program, double dt) {
    Trajectory out;
    start(program.field[0]);
    for (std::size_t i = 0; i < program.time.size(); ++i) {
      if (i > 0) {
        const double span = program.time[i] - program.time[i - 1];
        const int n = static_cast<int>(std::ceil(span / dt));
        for (int j = 1; j <= n; ++j)
          step(span / n, program.field[i - 1] + (program.field[i] - program.field[i - 1]) * j / n);
      }
      out.field.push_back(monitor_);
      out.charge.push_back(charge_seen_);
      out.displacement.push_back(clipped());
      out.force.push_back(force_seen_);
    }
    return out;
  }

 private:
  double of(std::string_view name) const {
    const auto found = p_.find(name);
    return found == p_.end() ? 0 : found->second;
  }
  bool has(std::string_view name) const { return p_.contains(name); }
  PlainTerm& empirical(std::string_view id) { return empirical_.find(id)->second; }
  const PlainTerm& empirical(std::string_view id) const { return empirical_.find(id)->second; }

  double saturation() const {
    return m_.material.remanent_polarization / (1 + of("polarization_fatigue.coefficient") * switched_);
  }

  // d/dt of the fractions of one domain (4.18-4.25).
  std::pair<double, double> slope(const Domain& d, double field) const {
    const auto& c = m_.material;
    const double e = field + d.field, s = stress_;
    const double g_plus = -0.5 * c.permittivity_180 * e * e - c.piezoelectric_180 * e * s -
                          0.5 * c.compliance_180 * s * s - e * saturation();
    const double g_minus = -0.5 * c.permittivity_180 * e * e + c.piezoelectric_180 * e * s -
                           0.5 * c.compliance_180 * s * s + e * saturation();
    const double g_90 =
        -0.5 * c.permittivity_90 * e * e - 0.5 * c.compliance_90 * s * s - s * c.remanent_strain_90;
    const double kt = 1.380649e-23 * c.temperature;
    const auto rate = [&](double f, double dg0) {
      const double barrier = f < -4 * dg0 ? -f : f > 4 * dg0 ? 0 : (f / 4 - dg0) * (f / 4 - dg0) / dg0;
      return std::exp(-barrier * c.activation_volume / kt) / c.relaxation_time;
    };
    const double back = d.barrier * (1 + of("stress_stabilized_90.coefficient") * std::max(0.0, -s));
    const double up = std::exp(of("empirical_asymmetry.log_ratio")), down = 1 / up;
    const double direct = d.barrier * of("empirical_direct.barrier_ratio");
    const double ratio = of("empirical_direct.rate_ratio");
    const double turned = ratio == 0 ? 0
                                     : ratio * (d.plus * rate(g_plus - g_minus, direct * down) -
                                                d.minus * rate(g_minus - g_plus, direct * up));
    const double ninety = 1 - d.plus - d.minus;
    return {
        ninety * rate(g_90 - g_plus, back * up) - d.plus * rate(g_plus - g_90, d.barrier * down) - turned,
        ninety * rate(g_90 - g_minus, back * down) - d.minus * rate(g_minus - g_90, d.barrier * up) + turned};
  }
  double switching(double field) const {
    double sum = 0;
    for (const auto& d : domains_) {
      const auto [plus, minus] = slope(d, field);
      sum += d.weight * (plus - minus);
    }
    return sum;
  }
  // The field that the rates see: e = E + mean field - coefficient P_+ (x+ - x-)'(e).
  double seen_by_rates() const {
    const double drag = of("domain_wall_drag.coefficient") * saturation();
    if (drag == 0)
      return field_ + empirical("empirical_rate").beyond(0, 1, 0) +
             of("mean_field_interaction.coefficient") * m_.material.remanent_polarization * order();
    double low = field_ - 2 * drag / m_.material.relaxation_time, high = 2 * field_ - low;
    for (int i = 0; i < 50; ++i) {
      const double e = 0.5 * (low + high);
      (e - field_ + drag * switching(e) > 0 ? high : low) = e;
    }
    return 0.5 * (low + high);
  }

  // Over the domains, wherever they have moved.
  void take_means() {
    plus_ = minus_ = 0;
    for (const auto& d : domains_) {
      plus_ += d.weight * d.plus;
      minus_ += d.weight * d.minus;
    }
  }
  double order() const { return plus_ - minus_; }
  double ninety() const { return 1 - plus_ - minus_; }
  double compliance() const {
    return m_.material.compliance_180 + (m_.material.compliance_90 - m_.material.compliance_180) * ninety();
  }
  double prestress() const {
    return m_.load.prestress * (1 - (has("prestress_relaxation.fraction")
                                         ? of("prestress_relaxation.fraction") *
                                               (1 - std::exp(-t_ / of("prestress_relaxation.time_constant")))
                                         : 0));
  }
  double spring(double x) const {
    const double added =
        has("empirical_spring.amplitude") ? empirical("empirical_spring").beyond_rest_at(x) : 0;
    if (has("contact_gap.gap")) x = std::max(0.0, x - of("contact_gap.gap"));
    return m_.load.spring_stiffness * (x * (1 + of("spring_hardening.coefficient") * x) + added);
  }
  double passive() const {
    return has("passive_layer_compliance.stiffness") ? 1 / of("passive_layer_compliance.stiffness") : 0;
  }

  double instant_strain(double field, double stress) const {
    return compliance() * stress + m_.material.piezoelectric_180 * order() * field +
           m_.material.remanent_strain_90 * ninety() + of("electrostriction.coefficient") * field * field +
           m_.material.compliance_180 * m_.load.prestress;
  }
  double delayed_strain() const {
    return std::accumulate(creep_.begin(), creep_.end(),
                           heat_ + viscous_ + empirical("empirical_strain").beyond_start());
  }
  double extension(double field, double stress) const {
    const double push = -(stress + prestress()) * m_.actuator.area;
    return m_.actuator.length * (instant_strain(field, stress) + delayed_strain()) - push * passive();
  }
  // The stress at this field: balance of forces, or what belongs to the place of the mass.
  double balance(double field) const {
    const double area = m_.actuator.area;
    const auto missing = [&](double stress) {
      const double x = extension(field, stress);
      if (has("stage_inertia.mass")) return x_ - x;
      return -(stress + prestress()) * area - spring(x) - of("guide_friction.force") * dahl_;
    };
    double a = stress_, b = stress_ + 1e4, fa = missing(a), fb = missing(b);
    for (int i = 0; i < 60 && fb != fa && std::abs(b - a) > 1e-3; ++i) {
      const double c = b - fb * (b - a) / (fb - fa);
      a = b, fa = fb, b = c, fb = missing(c);
    }
    return b;
  }
  double polarization(double field, double stress) const {
    const auto& c = m_.material;
    return (c.permittivity_180 + (c.permittivity_90 - c.permittivity_180) * ninety()) * field +
           c.piezoelectric_180 * order() * stress + saturation() * order() +
           c.permittivity_180 * of("nonlinear_permittivity.coefficient") * field * field * field +
           empirical("empirical_polarization").beyond_start();
  }
  double field_of(double wanted) const {
    double a = field_, b = field_ + 1e3;
    double fa = polarization(a, balance(a)) - wanted, fb = polarization(b, balance(b)) - wanted;
    for (int i = 0; i < 60 && fb != fa && std::abs(b - a) > 1e-3; ++i) {
      const double c = b - fb * (b - a) / (fb - fa);
      a = b, fa = fb, b = c, fb = polarization(c, balance(c)) - wanted;
    }
    return b;
  }

  void start(double command) {
    command_ = monitor_ = field_ = command;
    take_means();
    for (auto& [id, term] : empirical_)
      if (id != "empirical_spring") term.start(field_, order(), ninety());
    stress_ = -m_.load.prestress;
    stress_ = balance(field_);
    x_ = extension(field_, stress_);
    polarization_ = polarization(field_, stress_);
    order_ = order();
    charge_ = charge();
    charge_seen_ = charge_;
    const double force = prestress() * m_.actuator.area + spring(x_);
    force_seen_ = force;
    lagged_ = before_lag();
    sense_displacement();
  }
  double charge() const {
    return static_cast<double>(m_.actuator.layer_count) * m_.actuator.area *
           (polarization(field_, stress_) + leaked_);
  }

  void drive(double dt) {
    if (has("amplifier_lag.time_constant"))
      monitor_ += dt / of("amplifier_lag.time_constant") * (command_ - monitor_);
    else if (has("amplifier_slew_limit.rate"))
      monitor_ += std::clamp(command_ - monitor_, -of("amplifier_slew_limit.rate") * dt,
                             of("amplifier_slew_limit.rate") * dt);
    else
      monitor_ = command_;
    auto& term = empirical("empirical_drive");
    term.step(dt, command_, 1, 0);
    monitor_ += term.beyond(0, 0, 0);
  }

  void move(double dt, double x_before) {
    if (has("stage_inertia.mass")) {
      const double mass = of("stage_inertia.mass");
      const double actuator = 1 / (m_.actuator.length * compliance() / m_.actuator.area + passive());
      const double c =
          2 * of("stage_inertia.damping_ratio") * std::sqrt((m_.load.spring_stiffness + actuator) * mass);
      const double push = -(stress_ + prestress()) * m_.actuator.area;
      velocity_ += dt * (push - spring(x_) - c * velocity_) / mass;
      x_ += dt * velocity_;
    }
    if (has("source_resistance.coefficient")) {
      polarization_ += dt * (monitor_ - field_) / of("source_resistance.coefficient");
      field_ = field_of(polarization_);
    } else {
      field_ = monitor_;
    }
    for (const auto* id : {"empirical_strain", "empirical_polarization", "empirical_rate"})
      empirical(id).step(dt, field_, order(), ninety());
    stress_ = balance(field_);
    if (!has("stage_inertia.mass")) x_ = extension(field_, stress_);
    empirical("empirical_spring").step(dt, x_, 1, 0);
    if (has("guide_friction.force")) {
      const double moved = x_ - x_before;
      dahl_ += ((moved > 0 ? 1 : -1) - dahl_) * std::abs(moved) / of("guide_friction.presliding_distance");
    }
  }

  void strains(double dt) {
    const std::array<double, 5> tau{0.1, 1, 10, 100, 1000};
    const double instant = instant_strain(field_, stress_);
    for (std::size_t i = 0; i < 5; ++i)
      creep_[i] += dt / tau[i] * (of("logarithmic_creep.fraction_per_decade") * instant - creep_[i]);
    if (has("viscoelastic_creep.compliance"))
      viscous_ += dt / of("viscoelastic_creep.time_constant") *
                  (of("viscoelastic_creep.compliance") * (stress_ + m_.load.prestress) - viscous_);
    const double change = m_.material.remanent_polarization * (order() - order_);
    switched_ += std::abs(change);
    order_ = order();
    if (has("self_heating.time_constant"))
      heat_ += of("self_heating.strain_per_energy_density") * std::max(0.0, field_ * change) -
               dt * heat_ / of("self_heating.time_constant");
  }

  void step(double dt, double command) {
    const double e = seen_by_rates(), x_before = x_;
    std::vector<std::pair<double, double>> slopes;
    for (const auto& d : domains_) slopes.push_back(slope(d, e));
    for (std::size_t i = 0; i < domains_.size(); ++i) {
      domains_[i].plus += dt * slopes[i].first;
      domains_[i].minus += dt * slopes[i].second;
    }
    take_means();
    t_ += dt;
    command_ = command;
    drive(dt);
    move(dt, x_before);
    strains(dt);
    if (has("dielectric_leakage.resistivity")) leaked_ += dt * field_ / of("dielectric_leakage.resistivity");
    sense(dt);
  }

  double before_lag() const {
    double x = x_ * (1 + of("displacement_nonlinearity.coefficient") * x_);
    return x + of("displacement_crosstalk.coefficient") * monitor_ + of("displacement_drift.rate") * t_;
  }
  void sense_displacement() {
    history_.push_back(lagged_ + of("mains_pickup.amplitude") *
                                     std::sin(2 * std::numbers::pi * of("mains_pickup.frequency") * t_));
    times_.push_back(t_);
  }
  double clipped() const {
    double x = history_.back();
    if (has("displacement_delay.delay")) {
      const double then = t_ - of("displacement_delay.delay");
      const auto at = std::lower_bound(times_.begin(), times_.end(), then - 1e-12);
      x = history_[static_cast<std::size_t>(at - times_.begin())];
    }
    const double limit = has("displacement_clipping.limit") ? of("displacement_clipping.limit") : 1;
    return std::clamp(x, -limit, limit);
  }
  void sense(double dt) {
    const double last = charge_;
    charge_ = charge();
    charge_seen_ += charge_ - last + of("charge_offset_current.current") * dt;
    if (has("charge_amplifier_decay.time_constant"))
      charge_seen_ -= dt * charge_seen_ / of("charge_amplifier_decay.time_constant");
    const double force = prestress() * m_.actuator.area + spring(x_);
    if (has("load_cell_lag.time_constant")) {
      force_seen_ += dt / of("load_cell_lag.time_constant") * (force - force_seen_);
    } else {
      if (has("load_cell_creep.fraction"))
        crept_ += dt / of("load_cell_creep.time_constant") *
                  (force - m_.load.prestress * m_.actuator.area - crept_);
      force_seen_ = force + of("load_cell_creep.fraction") * crept_;
    }
    if (has("displacement_lag.time_constant"))
      lagged_ += dt / of("displacement_lag.time_constant") * (before_lag() - lagged_);
    else
      lagged_ = before_lag();
    sense_displacement();
  }

  Model m_;
  // They are asked for by name in each step, without a string being made.
  std::map<std::string, double, std::less<>> p_;
  std::vector<Domain> domains_;
  std::map<std::string, PlainTerm, std::less<>> empirical_;
  double t_ = 0, command_ = 0, monitor_ = 0, field_ = 0, stress_ = 0, x_ = 0, velocity_ = 0,
         polarization_ = 0;
  double plus_ = 1, minus_ = 0, order_ = 1, switched_ = 0, leaked_ = 0, heat_ = 0, viscous_ = 0, dahl_ = 0;
  std::array<double, 5> creep_{};
  double charge_ = 0, charge_seen_ = 0, force_seen_ = 0, crept_ = 0, lagged_ = 0;
  std::vector<double> history_, times_;
};

}  // namespace ferrobench::model

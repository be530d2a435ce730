#include "tests/campaign/mechanics.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "tests/campaign/sensors.h"

namespace ferrobench::campaign {
namespace {

constexpr std::array<double, 5> creep_times{0.1, 1, 10, 100, 1000};
constexpr double no_target = std::numeric_limits<double>::quiet_NaN();

double dahl(double z, double moved, double distance) {
  const double end = moved > 0 ? 1 : -1;
  return end + (z - end) * std::exp(-std::abs(moved) / distance);
}

}  // namespace

// What one stress brings about.
struct Mechanics::Parts {
  double instant = 0, viscous = 0, displacement = 0, friction = 0, direction = 0, missing = 0;
  std::array<double, 5> creep{};
};

double Mechanics::prestress(double time) const {
  return m_.load.prestress * (1 - t_.relaxation * (1 - std::exp(-std::max(0.0, time) / t_.relaxation_time)));
}

double Mechanics::spring(double x, double direction) const {
  const double seen = t_.gap ? std::max(0.0, x - *t_.gap) : x;
  return m_.load.spring_stiffness * seen * (1 + t_.hardening * seen) * (1 + t_.spring_direction * direction) +
         m_.load.spring_stiffness * t_.spring_width * direction;
}

double Mechanics::compliance(const State& s) const {
  const auto& c = m_.material;
  return c.compliance_180 + (c.compliance_90 - c.compliance_180) * s.ninety();
}

double Mechanics::stiffness(const State& s) const {
  return 1 / (compliance(s) * m_.actuator.length / m_.actuator.area + t_.passive_compliance);
}

Mechanics::Parts Mechanics::parts(const State& from, const State& to, double h, double stress) const {
  const auto& c = m_.material;
  const double e = to.field, order = to.order();
  Parts p;
  p.instant = compliance(to) * stress + c.piezoelectric_180 * order * e + c.remanent_strain_90 * to.ninety() +
              c.compliance_180 * m_.load.prestress + t_.electrostriction * e * e +
              t_.field_dependence * order * e * std::abs(e) + t_.order_squared * (order * order - 1) -
              rest_strain_;
  double strain = p.instant + to.heat;
  if (t_.creep != 0)
    for (std::size_t i = 0; i < creep_times.size(); ++i)
      strain += p.creep[i] =
          low_pass(from.creep[i], t_.creep * from.instant_strain, t_.creep * p.instant, h, creep_times[i]);
  if (t_.viscous != 0) {
    const double rest = -m_.load.prestress;
    strain += p.viscous = low_pass(from.viscous, t_.viscous * (from.stress - rest),
                                   t_.viscous * (stress - rest), h, t_.viscous_time);
  }
  const double push = -(stress + prestress(to.time)) * m_.actuator.area;
  p.displacement = m_.actuator.length * strain - push * t_.passive_compliance;
  const double moved = p.displacement - from.displacement;
  if (t_.friction != 0) p.friction = h > 0 ? dahl(from.friction, moved, t_.presliding) : from.friction;
  if (t_.spring_remembers())
    p.direction = h > 0 ? dahl(from.direction, moved, t_.spring_distance) : from.direction;
  p.missing = push - spring(p.displacement, p.direction) - t_.friction * p.friction;
  return p;
}

// The stress at which nothing is missing, or, with a mass, at which x is where the mass is. What is missing
// falls with rising stress, so it can be closed in on: regula falsi with the Illinois rule.
double Mechanics::balanced_stress(const State& from, const State& to, double h, double target) const {
  const bool placed = !std::isnan(target);
  const auto missing = [&](double stress) {
    const auto p = parts(from, to, h, stress);
    return placed ? (target - p.displacement) * stiffness(to) : p.missing;
  };
  double a = from.stress - 1e4, fa = missing(a), b = from.stress + 1e4, fb = missing(b);
  for (double reach = 1e5; fa < 0 || fb > 0; reach *= 4) {
    // Widened on the side that the line through both points leads to.
    if (fa < 0) b = a, fb = fa, a -= reach, fa = missing(a);
    if (fb > 0) a = b, fa = fb, b += reach, fb = missing(b);
    if (reach > 1e12) throw Error(ErrorCode::numerical, "the twin finds no equilibrium");
  }
  const double scale = 1e-9 * (m_.load.prestress + 1e6) * m_.actuator.area;
  double c = a, side = 0;
  for (int i = 0; i < 100; ++i) {
    c = fb == fa ? 0.5 * (a + b) : b - fb * (b - a) / (fb - fa);
    const double fc = missing(c);
    if (std::abs(fc) < scale || b - a < 1e-6) break;
    if (fc > 0) {
      if (side > 0) fb *= 0.5;
      a = c, fa = fc, side = 1;
    } else {
      if (side < 0) fa *= 0.5;
      b = c, fb = fc, side = -1;
    }
  }
  return c;
}

// x if nothing pushed back, at the stress that the state has.
double Mechanics::free_extension(const State& s) const {
  const double push = -(s.stress + prestress(s.time)) * m_.actuator.area;
  return s.displacement + push / stiffness(s);
}

double Mechanics::period() const {
  if (t_.mass == 0) return 0;
  return 2 * std::numbers::pi * std::sqrt(t_.mass / (stiffness(State{}) + m_.load.spring_stiffness));
}

// m x'' + c x' + F_spring = k_act (x_free - x), x_free linear over the step: Runge-Kutta in 24 parts of a
// period.
void Mechanics::swing(const State& from, State& to, double h) const {
  const double actuator = stiffness(to);
  const double damping = 2 * t_.damping_ratio * std::sqrt((m_.load.spring_stiffness + actuator) * t_.mass);
  const double start = free_extension(from), end = free_extension(to);
  // What rang before this has died out by a factor e^-15.
  const double memory = 15 / t_.damping_ratio * period() / (2 * std::numbers::pi);
  double x = from.displacement, v = from.velocity, span = h;
  if (h > memory) {
    span = memory;
    v = (to.settled_displacement - from.settled_displacement) / h;
    x = to.settled_displacement - v * span;
  }
  const int n = static_cast<int>(std::ceil(24 * span / period()));
  const double dt = span / n;
  const auto acceleration = [&](double since, double at, double speed) {
    const double free = start + (end - start) * since / h;
    const double rub =
        t_.friction == 0 ? 0 : t_.friction * dahl(from.friction, at - from.displacement, t_.presliding);
    const double moved = at - from.displacement;
    const double direction =
        t_.spring_remembers() ? dahl(from.direction, moved, t_.spring_distance) : from.direction;
    return (actuator * (free - at) - spring(at, direction) - rub - damping * speed) / t_.mass;
  };
  for (int i = 0; i < n; ++i) {
    const double t = h - span + i * dt;
    const double a1 = acceleration(t, x, v);
    const double v2 = v + 0.5 * dt * a1, a2 = acceleration(t + 0.5 * dt, x + 0.5 * dt * v, v2);
    const double v3 = v + 0.5 * dt * a2, a3 = acceleration(t + 0.5 * dt, x + 0.5 * dt * v2, v3);
    const double v4 = v + dt * a3, a4 = acceleration(t + dt, x + dt * v3, v4);
    x += dt / 6 * (v + 2 * v2 + 2 * v3 + v4);
    v += dt / 6 * (a1 + 2 * a2 + 2 * a3 + a4);
  }
  to.displacement = x;
  to.velocity = v;
}

void Mechanics::rest_in(const State& state) {
  rest_strain_ = 0;
  rest_strain_ = parts(state, state, 0, -m_.load.prestress).instant;
}

void Mechanics::settle(const State& from, State& to, double h) const {
  const auto& c = m_.material;
  const double change = c.remanent_polarization * (to.order() - from.order());
  to.switched = from.switched + std::abs(change);
  to.conducted = from.conducted + 0.5 * h * (from.field + to.field) * t_.conductivity;
  if (t_.heat != 0)
    to.heat =
        from.heat * std::exp(-h / t_.heat_time) +
        t_.heat * std::max(0.0, 0.5 * (from.field + to.field) * change) * std::exp(-0.5 * h / t_.heat_time);
  to.stress = to.settled_stress = balanced_stress(from, to, h, no_target);
  auto p = parts(from, to, h, to.stress);
  to.displacement = to.settled_displacement = p.displacement;
  if (t_.mass != 0 && h > 0) {
    swing(from, to, h);
    to.stress = balanced_stress(from, to, h, to.displacement);
    p = parts(from, to, h, to.stress);
  }
  to.instant_strain = p.instant;
  to.viscous = p.viscous;
  to.creep = p.creep;
  to.friction = p.friction;
  to.direction = p.direction;
}

double Mechanics::force(const State& s) const {
  return prestress(s.time) * m_.actuator.area + spring(s.displacement, s.direction);
}

double Mechanics::remanent(const State& s) const {
  return m_.material.remanent_polarization / (1 + t_.fatigue * s.switched);
}

double Mechanics::polarization(const State& s) const {
  const auto& c = m_.material;
  const double permittivity = c.permittivity_180 + (c.permittivity_90 - c.permittivity_180) * s.ninety();
  return permittivity * s.field + c.piezoelectric_180 * s.order() * s.stress + remanent(s) * s.order() +
         c.permittivity_180 * t_.cubic_permittivity * s.field * s.field * s.field;
}

}  // namespace ferrobench::campaign

#include "model/physics/mechanics.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "model/physics/wells.h"

namespace ferrobench::model {

Mechanics::Mechanics(const Model& model, Ports& ports)
    : material_(model.material), actuator_(model.actuator), load_(model.load), ports_(ports) {
  linear_ = ports.strain.empty() && ports.spring_extension.empty() && ports.spring_hardening.empty() &&
            !ports.prestress_factor && !ports.friction && !ports.inertia;
  strain_at_rest_ = -material_.compliance_180 * load_.prestress;
  if (ports.inertia && !actuator_.passive_stiffness &&
      std::min(material_.compliance_180, material_.compliance_90) <= 0)
    throw Error(ErrorCode::bad_model, "a mass needs an actuator that gives way",
                Problem{.path = "/material/compliance_180",
                        .message = "must be above zero with the effect stage_inertia",
                        .given = material_.compliance_180,
                        .unit = "1/Pa"});
}

bool Mechanics::stress_is_constant() const {
  return load_.spring_stiffness == 0 && !ports_.prestress_factor && !ports_.friction && !ports_.inertia;
}

double Mechanics::mean_compliance(const MaterialState& s) const {
  return material_.compliance_180 + (material_.compliance_90 - material_.compliance_180) * s.ninety();
}

double Mechanics::strain_without_terms(const MaterialState& s, double stress) const {
  return mean_compliance(s) * stress + material_.piezoelectric_180 * (s.plus - s.minus) * s.field +
         material_.remanent_strain_90 * s.ninety();
}

double Mechanics::spring_force(double extension) const {
  double seen = extension;
  for (const auto& f : ports_.spring_extension) seen = f(seen);
  double force = load_.spring_stiffness * seen;
  for (const auto& f : ports_.spring_hardening) force *= f(seen);
  return force;
}

double Mechanics::spring_slope(double extension) const {
  constexpr double reach = 1e-9;  // m
  return std::max(0.0, (spring_force(extension + reach) - spring_force(extension - reach)) / (2 * reach));
}

double Mechanics::prestress(double time) const {
  return ports_.prestress_factor ? load_.prestress * ports_.prestress_factor(time) : load_.prestress;
}

// Dahl's z after a move that does not turn back: z' = (sgn(x') - z) |x'| / distance.
double Mechanics::friction_state(double extension) const {
  const double moved = extension - last_extension_;
  const double end = moved > 0 ? 1 : -1;
  return end + (friction_state_ - end) * std::exp(-std::abs(moved) / ports_.friction->presliding_distance);
}

double Mechanics::friction(double extension) const {
  return ports_.friction ? ports_.friction->force * friction_state(extension) : 0;
}

void Mechanics::start(MaterialState& at) {
  moving_.reset();
  last_extension_ = friction_state_ = 0;
  for (auto& term : ports_.strain) term->start(at);
  accept(0, at);
}

Equilibrium Mechanics::linear(const MaterialState& s) const {
  const double share =
      actuator_.passive_stiffness
          ? *actuator_.passive_stiffness / (load_.spring_stiffness + *actuator_.passive_stiffness)
          : 1;
  const double stress_per_strain = load_.spring_stiffness * share * actuator_.length / actuator_.area;
  const double free_strain = strain_without_terms(s, 0) - strain_at_rest_;
  Equilibrium out;
  out.stress =
      (-load_.prestress - stress_per_strain * free_strain) / (1 + stress_per_strain * mean_compliance(s));
  out.strain = strain_without_terms(s, out.stress);
  out.displacement = share * actuator_.length * (out.strain - strain_at_rest_);
  out.force = load_.prestress * actuator_.area + load_.spring_stiffness * out.displacement;
  return out;
}

double Mechanics::unbalanced(double h, double stress, MaterialState& end, Equilibrium& out) const {
  const double pre = prestress(end.time);
  end.stress = out.stress = stress;
  double strain = strain_without_terms(end, stress);
  for (const auto& term : ports_.strain)
    if (term->instant()) strain += term->propose(h, end);
  end.instant_strain = strain - strain_at_rest_;
  for (const auto& term : ports_.strain)
    if (!term->instant()) strain += term->propose(h, end);
  out.strain = strain;
  const double push = -(stress + pre) * actuator_.area;
  out.displacement = actuator_.length * (strain - strain_at_rest_);
  if (actuator_.passive_stiffness) out.displacement -= push / *actuator_.passive_stiffness;
  const double spring = spring_force(out.displacement);
  out.force = pre * actuator_.area + spring;
  if (moving_)
    return actuator_stiffness(end) * (move(h, end, out).position - out.displacement) / actuator_.area;
  return (push - spring - friction(out.displacement)) / actuator_.area;
}

// The secant method on the stress, exact in two evaluations where all is linear. What is missing for balance
// falls with rising stress; once its root is bracketed no step may leave the bracket.
Equilibrium Mechanics::general(double h, MaterialState& end) const {
  Equilibrium out;
  double low = -std::numeric_limits<double>::infinity(), high = -low;
  const auto missing = [&](double stress) {
    const double f = unbalanced(h, stress, end, out);
    if (f > 0) low = std::max(low, stress);
    if (f < 0) high = std::min(high, stress);
    return f;
  };
  double a = linear(end).stress, fa = missing(a);
  const double scale = 1e-12 * (std::abs(load_.prestress) + 1e6);
  double b = a + std::max(1e3, 1e-3 * std::abs(a)), fb = missing(b);
  for (int i = 0; i < 100 && std::abs(fb) > scale && fb != fa; ++i) {
    double c = b - fb * (b - a) / (fb - fa);
    if (!(c >= low && c <= high)) c = 0.5 * (low + high);
    if (!std::isfinite(c) || c == b) break;
    a = b;
    fa = fb;
    b = c;
    fb = missing(b);
  }
  return out;
}

double Mechanics::actuator_stiffness(const MaterialState& s) const {
  double compliance = mean_compliance(s) * actuator_.length / actuator_.area;
  if (actuator_.passive_stiffness) compliance += 1 / *actuator_.passive_stiffness;
  return 1 / compliance;
}

// x if nothing pushed back.
double Mechanics::free_extension(const MaterialState& s, const Equilibrium& e) const {
  return e.displacement - (e.stress + prestress(s.time)) * actuator_.area / actuator_stiffness(s);
}

Oscillator Mechanics::oscillator(const MaterialState& s) const {
  const double actuator = actuator_stiffness(s);
  return {.mass = ports_.inertia->mass,
          .damping = 2 * ports_.inertia->damping_ratio *
                     std::sqrt((load_.spring_stiffness + actuator) * ports_.inertia->mass),
          .stiffness = actuator + spring_slope(moving_->motion.position)};
}

// Where the mass goes in a step that ends with x, and all that follows from x, as in `e`: the spring's force
// off its tangent and the friction count as linear in time.
Motion Mechanics::move(double h, const MaterialState& end, const Equilibrium& e) const {
  const auto o = oscillator(end);
  const double actuator = actuator_stiffness(end), tangent = o.stiffness - actuator;
  const double from = moving_->motion.position;
  const double f0 = actuator * moving_->free_extension - friction(from) - spring_force(from) + tangent * from;
  const double f1 = actuator * free_extension(end, e) - friction(e.displacement) -
                    spring_force(e.displacement) + tangent * e.displacement;
  return swing(o, moving_->motion, f0, f1, h);
}

Mechanics::Moving Mechanics::moved(double h, const MaterialState& end, const Equilibrium& e) const {
  Moving out{.motion = {e.displacement, 0},
             .free_extension = free_extension(end, e),
             .steady_velocity = 0,
             .slew = 0,
             .material = end};
  if (!moving_ || h <= 0) return out;
  out.motion.velocity = move(h, end, e).velocity;
  const double share = actuator_stiffness(end) / oscillator(end).stiffness;
  out.steady_velocity = share * (out.free_extension - moving_->free_extension) / h;
  out.slew = (end.field - moving_->material.field) / h;
  return out;
}

Equilibrium Mechanics::propose(double h, MaterialState& end) const {
  if (!linear_) return general(h, end);
  const auto out = linear(end);
  end.stress = out.stress;
  end.instant_strain = out.strain - strain_at_rest_;
  return out;
}

void Mechanics::accept(double h, MaterialState& end) {
  const auto out = propose(h, end);
  if (ports_.inertia) moving_ = moved(h, end, out);
  for (auto& term : ports_.strain) term->accept(h, end);
  if (ports_.friction) friction_state_ = friction_state(out.displacement);
  last_extension_ = out.displacement;
}

double Mechanics::largest_step(double slew) const {
  if (!moving_) return std::numeric_limits<double>::infinity();
  const auto& s = moving_->material;
  const auto o = oscillator(s);
  const double actuator = actuator_stiffness(s), x = moving_->motion.position;
  const double field_turns =
      actuator_.length * material_.piezoelectric_180 * (s.plus - s.minus) * (slew - moving_->slew);
  const double velocity = moving_->steady_velocity + actuator / o.stiffness * field_turns;
  const double force = actuator * (moving_->free_extension - x) - friction(x) - spring_force(x);
  const double off = -(force - o.damping * velocity) / o.stiffness;
  const double ringing = std::hypot(off, (moving_->motion.velocity - velocity) / o.frequency());
  const auto k = kinetic_constants(material_);
  const double change = k.inverse_energy * (std::abs(k.strain_90) + std::abs(k.piezoelectric * s.field)) *
                        actuator * ringing / actuator_.area;  // of ln(rate)
  constexpr double noticed = 0.03;
  constexpr double twentieth_of_period = 0.05 * 2 * std::numbers::pi;
  return twentieth_of_period / o.frequency() * std::max(1.0, noticed / std::max(change, 1e-300));
}

}  // namespace ferrobench::model

#include "model/physics/mechanics.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace ferrobench::model {

Mechanics::Mechanics(const Model& model, Ports& ports)
    : material_(model.material), actuator_(model.actuator), load_(model.load), ports_(ports) {
  linear_ = ports.strain.empty() && ports.spring_extension.empty() && ports.spring_hardening.empty() &&
            !ports.prestress_factor && !ports.friction && !ports.inertia;
  strain_at_rest_ = -material_.compliance_180 * load_.prestress;
}

bool Mechanics::stress_is_constant() const {
  return load_.spring_stiffness == 0 && !ports_.prestress_factor && !ports_.friction && !ports_.inertia;
}

double Mechanics::strain_without_terms(const MaterialState& s, double stress) const {
  const double compliance =
      material_.compliance_180 + (material_.compliance_90 - material_.compliance_180) * s.ninety();
  return compliance * stress + material_.piezoelectric_180 * (s.plus - s.minus) * s.field +
         material_.remanent_strain_90 * s.ninety();
}

double Mechanics::spring_force(double extension) const {
  double seen = extension;
  for (const auto& f : ports_.spring_extension) seen = f(seen);
  double force = load_.spring_stiffness * seen;
  for (const auto& f : ports_.spring_hardening) force *= f(seen);
  return force;
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

void Mechanics::start(MaterialState& at) {
  last_extension_ = friction_state_ = 0;
  for (auto& term : ports_.strain) term->start(at);
  accept(0, at);
}

Equilibrium Mechanics::linear(const MaterialState& s) const {
  const double share =
      actuator_.passive_stiffness
          ? *actuator_.passive_stiffness / (load_.spring_stiffness + *actuator_.passive_stiffness)
          : 1;
  const double compliance =
      material_.compliance_180 + (material_.compliance_90 - material_.compliance_180) * s.ninety();
  const double stress_per_strain = load_.spring_stiffness * share * actuator_.length / actuator_.area;
  const double free_strain = strain_without_terms(s, 0) - strain_at_rest_;
  Equilibrium out;
  out.stress = (-load_.prestress - stress_per_strain * free_strain) / (1 + stress_per_strain * compliance);
  out.strain = strain_without_terms(s, out.stress);
  out.displacement = share * actuator_.length * (out.strain - strain_at_rest_);
  out.force = load_.prestress * actuator_.area + load_.spring_stiffness * out.displacement;
  return out;
}

// Newton's method on the stress, with the secant for the slope: exact in two evaluations where all is linear.
Equilibrium Mechanics::general(double h, MaterialState& end) const {
  const double pre = prestress(end.time);
  Equilibrium out;
  const auto residual = [&](double stress) {
    end.stress = stress;
    double strain = strain_without_terms(end, stress);
    for (const auto& term : ports_.strain)
      if (term->instant()) strain += term->propose(h, end);
    end.instant_strain = strain - strain_at_rest_;
    for (const auto& term : ports_.strain)
      if (!term->instant()) strain += term->propose(h, end);
    out.strain = strain;
    const double push = -(stress + pre) * actuator_.area;  // of the actuator beyond the prestress, N
    out.displacement = actuator_.length * (strain - strain_at_rest_);
    if (actuator_.passive_stiffness) out.displacement -= push / *actuator_.passive_stiffness;
    double against = spring_force(out.displacement);
    out.force = pre * actuator_.area + against;
    if (ports_.friction) against += ports_.friction->force * friction_state(out.displacement);
    return (push - against) / actuator_.area;
  };
  double a = linear(end).stress, fa = residual(a);
  const double scale = 1e-12 * (std::abs(load_.prestress) + 1e6);
  double b = a + std::max(1e3, 1e-3 * std::abs(a)), fb = residual(b);
  for (int i = 0; i < 50 && std::abs(fb) > scale && fb != fa; ++i) {
    const double c = b - fb * (b - a) / (fb - fa);
    a = b;
    fa = fb;
    b = c;
    fb = residual(b);
  }
  out.stress = b;
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
  for (auto& term : ports_.strain) term->accept(h, end);
  if (ports_.friction) friction_state_ = friction_state(out.displacement);
  last_extension_ = out.displacement;
}

double Mechanics::largest_step() const {
  return std::numeric_limits<double>::infinity();
}

}  // namespace ferrobench::model

// The members of Mechanics. Included by mechanics.cpp, and where they are compiled for each instruction set.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "model/physics/mechanics.h"
#include "model/physics/wells.h"

namespace ferrobench::model {

template <class T>
Mechanics<T>::Mechanics(const ModelOf<T>& model, PortsOf<T>& ports)
    : material_(model.material), actuator_(model.actuator), load_(model.load), ports_(ports) {
  const bool by_stress = std::any_of(ports.strain.begin(), ports.strain.end(),
                                     [](const auto& term) { return term->by_stress(); });
  linear_ = !by_stress && ports.spring_extension.empty() && ports.spring_hardening.empty() &&
            ports.spring.empty() && !ports.prestress_factor && !ports.friction && !ports.inertia;
  strain_at_rest_ = -material_.compliance_180 * load_.prestress;
  if (ports.inertia && !actuator_.passive_stiffness &&
      std::min(material_.compliance_180, material_.compliance_90) <= 0)
    throw Error(ErrorCode::bad_model, "a mass needs an actuator that gives way",
                Problem{.path = "/material/compliance_180",
                        .message = "must be above zero with the effect stage_inertia",
                        .given = value_of(material_.compliance_180),
                        .unit = "1/Pa"});
}

template <class T>
bool Mechanics<T>::stress_is_constant() const {
  return vanishes(load_.spring_stiffness) && !ports_.prestress_factor && !ports_.friction && !ports_.inertia;
}

template <class T>
T Mechanics<T>::mean_compliance(const MaterialState<T>& s) const {
  return material_.compliance_180 + (material_.compliance_90 - material_.compliance_180) * s.ninety();
}

// What may be missing for balance, Pa: far below what the kinetics notice.
template <class T>
double Mechanics<T>::balance() const {
  return balance_ * (std::abs(value_of(load_.prestress)) + 1e6);
}

template <class T>
T Mechanics<T>::strain_without_terms(const MaterialState<T>& s, const T& stress) const {
  return mean_compliance(s) * stress + material_.piezoelectric_180 * (s.plus - s.minus) * s.field +
         material_.remanent_strain_90 * s.ninety();
}

template <class T>
T Mechanics<T>::spring_force(const T& extension) const {
  T seen = extension;
  for (const auto& f : ports_.spring_extension) seen = f(seen);
  T force = load_.spring_stiffness * seen;
  for (const auto& f : ports_.spring_hardening) force *= f(seen);
  for (const auto& term : ports_.spring) force += load_.spring_stiffness * term->propose(extension);
  return force;
}

template <class T>
T Mechanics<T>::spring_slope(const T& extension) const {
  constexpr double reach = 1e-9;  // m
  return std::max(T(0), (spring_force(extension + reach) - spring_force(extension - reach)) / (2 * reach));
}

template <class T>
T Mechanics<T>::prestress(const T& time) const {
  if (!ports_.prestress_factor) return load_.prestress;
  return load_.prestress * ports_.prestress_factor(time < 0 ? T(0) : time);
}

// Dahl's z after a move that does not turn back: z' = (sgn(x') - z) |x'| / distance.
template <class T>
T Mechanics<T>::friction_state(const T& extension) const {
  const T moved = extension - last_extension_;
  const double end = moved > 0 ? 1 : -1;
  return end + (friction_state_ - end) * exp(-abs(moved) / ports_.friction->presliding_distance);
}

template <class T>
T Mechanics<T>::friction(const T& extension) const {
  return ports_.friction ? ports_.friction->force * friction_state(extension) : T(0);
}

template <class T>
void Mechanics<T>::start(MaterialState<T>& at) {
  moving_.reset();
  strain_at_rest_ = -mean_compliance(at) * load_.prestress;
  if (!vanishes(at.ninety())) strain_at_rest_ += material_.remanent_strain_90 * at.ninety();
  last_extension_ = friction_state_ = T(0);
  for (auto& term : ports_.strain) term->start(at);
  for (auto& term : ports_.spring) term->start();
  accept(0, at);
}

// Of the terms.
template <class T>
T Mechanics<T>::strain_apart_from_stress(const T& h, const MaterialState<T>& s) const {
  T strain = 0;
  for (const auto& term : ports_.strain)
    if (!term->by_stress()) strain += term->propose(h, s);
  return strain;
}

template <class T>
Equilibrium<T> Mechanics<T>::linear(const T& h, const MaterialState<T>& s) const {
  const T share = actuator_.passive_stiffness
                      ? *actuator_.passive_stiffness / (load_.spring_stiffness + *actuator_.passive_stiffness)
                      : T(1);
  const T stress_per_strain = load_.spring_stiffness * share * actuator_.length / actuator_.area;
  const T added = strain_apart_from_stress(h, s);
  const T free_strain = strain_without_terms(s, 0) - strain_at_rest_ + added;
  Equilibrium<T> out;
  out.stress =
      (-load_.prestress - stress_per_strain * free_strain) / (1 + stress_per_strain * mean_compliance(s));
  out.strain = strain_without_terms(s, out.stress) + added;
  out.displacement = share * actuator_.length * (out.strain - strain_at_rest_);
  out.force = load_.prestress * actuator_.area + load_.spring_stiffness * out.displacement;
  return out;
}

template <class T>
T Mechanics<T>::unbalanced(const T& h, const T& stress, MaterialState<T>& end, Equilibrium<T>& out) const {
  const T pre = prestress(end.time);
  end.stress = out.stress = stress;
  T strain = strain_without_terms(end, stress);
  for (const auto& term : ports_.strain)
    if (term->instant()) strain += term->propose(h, end);
  end.instant_strain = strain - strain_at_rest_;
  for (const auto& term : ports_.strain)
    if (!term->instant()) strain += term->propose(h, end);
  out.strain = strain;
  const T push = -(stress + pre) * actuator_.area;
  out.displacement = actuator_.length * (strain - strain_at_rest_);
  if (actuator_.passive_stiffness) out.displacement -= push / *actuator_.passive_stiffness;
  const T spring = spring_force(out.displacement);
  out.force = pre * actuator_.area + spring;
  if (moving_)
    return actuator_stiffness(end) * (move(h, end, out).position - out.displacement) / actuator_.area;
  return (push - spring - friction(out.displacement)) / actuator_.area;
}

// A root of what is missing for balance, which falls with rising stress: once it is bracketed no step may
// leave the bracket.
class Bracket {
 public:
  void learn(double stress, double missing) {
    if (missing > 0) low_ = std::max(low_, stress);
    if (missing < 0) high_ = std::min(high_, stress);
  }
  double keep(double stress) const {
    return stress >= low_ && stress <= high_ ? stress : 0.5 * (low_ + high_);
  }

 private:
  double low_ = -std::numeric_limits<double>::infinity(), high_ = std::numeric_limits<double>::infinity();
};

// The secant method on the stress, exact in two evaluations where all is linear.
template <class T>
Equilibrium<T> Mechanics<T>::general(const T& h, MaterialState<T>& end) const {
  if constexpr (has_tangents<T>) {
    return by_newton(h, end);
  } else {
    Equilibrium<T> out;
    Bracket bracket;
    const auto missing = [&](double stress) {
      const double f = unbalanced(h, stress, end, out);
      bracket.learn(stress, f);
      return f;
    };
    double a = linear(h, end).stress, fa = missing(a);
    const double scale = balance();
    double b = a + std::max(1e3, 1e-3 * std::abs(a)), fb = missing(b);
    for (int i = 0; i < 100 && std::abs(fb) > scale && fb != fa; ++i) {
      const double c = bracket.keep(b - fb * (b - a) / (fb - fa));
      if (!std::isfinite(c) || c == b) break;
      a = b;
      fa = fb;
      b = c;
      fb = missing(b);
    }
    return out;
  }
}

template <class T>
Equilibrium<T> Mechanics<T>::by_newton(const T& h, MaterialState<T>& end) const {
  Equilibrium<T> out;
  if constexpr (has_tangents<T>) {
    Bracket bracket;
    const double scale = balance();
    double at = end.stress.value;
    for (int i = 0;; ++i) {
      const T missing = unbalanced(h, unknown<T>(at, implicit_direction), end, out);
      bracket.learn(at, missing.value);
      const double next = bracket.keep(at - missing.value / missing.tangent[implicit_direction]);
      if (i == 100 || !(std::abs(missing.value) > scale) || next == at || !std::isfinite(next)) {
        const auto moves = implicit_tangents(missing);
        for (T* y :
             {&end.stress, &end.instant_strain, &out.stress, &out.displacement, &out.strain, &out.force})
          eliminate(*y, moves);
        break;
      }
      at = next;
    }
  }
  return out;
}

template <class T>
T Mechanics<T>::actuator_stiffness(const MaterialState<T>& s) const {
  T compliance = mean_compliance(s) * actuator_.length / actuator_.area;
  if (actuator_.passive_stiffness) compliance += 1 / *actuator_.passive_stiffness;
  return 1 / compliance;
}

// x if nothing pushed back.
template <class T>
T Mechanics<T>::free_extension(const MaterialState<T>& s, const Equilibrium<T>& e) const {
  return e.displacement - (e.stress + prestress(s.time)) * actuator_.area / actuator_stiffness(s);
}

template <class T>
OscillatorOf<T> Mechanics<T>::oscillator(const MaterialState<T>& s) const {
  const T actuator = actuator_stiffness(s);
  return {.mass = ports_.inertia->mass,
          .damping = 2 * ports_.inertia->damping_ratio *
                     sqrt((load_.spring_stiffness + actuator) * ports_.inertia->mass),
          .stiffness = actuator + spring_slope(moving_->motion.position)};
}

// Where the mass goes in a step that ends with x, and all that follows from x, as in `e`: the spring's force
// off its tangent and the friction count as linear in time.
template <class T>
MotionOf<T> Mechanics<T>::move(const T& h, const MaterialState<T>& end, const Equilibrium<T>& e) const {
  const auto o = oscillator(end);
  const T actuator = actuator_stiffness(end), tangent = o.stiffness - actuator;
  const T from = moving_->motion.position;
  const T f0 = actuator * moving_->free_extension - friction(from) - spring_force(from) + tangent * from;
  const T f1 = actuator * free_extension(end, e) - friction(e.displacement) - spring_force(e.displacement) +
               tangent * e.displacement;
  return swing(o, moving_->motion, f0, f1, h);
}

template <class T>
typename Mechanics<T>::Moving Mechanics<T>::moved(const T& h, const MaterialState<T>& end,
                                                  const Equilibrium<T>& e) const {
  Moving out{.motion = {e.displacement, 0},
             .free_extension = free_extension(end, e),
             .steady_velocity = 0,
             .slew = 0,
             .material = end};
  if (!moving_ || h <= 0) return out;
  out.motion.velocity = move(h, end, e).velocity;
  const T share = actuator_stiffness(end) / oscillator(end).stiffness;
  out.steady_velocity = share * (out.free_extension - moving_->free_extension) / h;
  out.slew = (end.field - moving_->material.field) / h;
  return out;
}

template <class T>
Equilibrium<T> Mechanics<T>::propose(const T& h, MaterialState<T>& end) const {
  if (!linear_) return general(h, end);
  const auto out = linear(h, end);
  end.stress = out.stress;
  end.instant_strain = strain_without_terms(end, out.stress) - strain_at_rest_;
  return out;
}

template <class T>
void Mechanics<T>::accept(const T& h, MaterialState<T>& end) {
  const auto out = propose(h, end);
  if (ports_.inertia) moving_ = moved(h, end, out);
  for (auto& term : ports_.strain) term->accept(h, end);
  for (auto& term : ports_.spring) term->accept(out.displacement);
  if (ports_.friction) friction_state_ = friction_state(out.displacement);
  last_extension_ = out.displacement;
}

template <class T>
double Mechanics<T>::largest_step(double slew, double tolerance) const {
  if (!moving_) return std::numeric_limits<double>::infinity();
  const auto& s = moving_->material;
  const auto o = oscillator(s);
  const T actuator = actuator_stiffness(s), x = moving_->motion.position;
  const T field_turns =
      actuator_.length * material_.piezoelectric_180 * (s.plus - s.minus) * (slew - moving_->slew);
  const T velocity = moving_->steady_velocity + actuator / o.stiffness * field_turns;
  const T force = actuator * (moving_->free_extension - x) - friction(x) - spring_force(x);
  const T off = -(force - o.damping * velocity) / o.stiffness;
  const T ringing = hypot(off, (moving_->motion.velocity - velocity) / o.frequency());
  const auto k = kinetic_constants(material_);
  const double change = value_of(k.inverse_energy * (abs(k.strain_90) + abs(k.piezoelectric * s.field)) *
                                 actuator * ringing / actuator_.area);  // of ln(rate)
  constexpr double noticed = 0.03;
  // A twentieth of the period leaves an error of 5e-6 of the displacement's range (root mean square) in loops
  // whose corners ring through switching. The error grows with the square of the step, and is kept in
  // proportion to the tolerance; beyond a fifth of the period the phase at which a step ends would decide.
  constexpr double twentieth_of_period = 0.05 * 2 * std::numbers::pi, as_fine = 1e-5, longest = 4;
  const double longer = std::clamp(std::sqrt(tolerance / as_fine), 1.0, longest);
  return longer * twentieth_of_period / value_of(o.frequency()) *
         std::max(1.0, noticed / std::max(change, 1e-300));
}

}  // namespace ferrobench::model

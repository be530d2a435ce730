// The actuator against spring, passive layers, prestress and, if there is one, the mass of the stage
// (4.1-4.4).
//
//   strain        S = <s> sigma + <d> E + eps_90 x90 + terms                              1
//   active        dx_active = L (S - S_ref),  S_ref = S at rest (E = 0, sigma = -sigma_pre)      m
//   push          N = -(sigma + sigma_pre(t)) A                                           N
//   displacement  x = dx_active - N / k_na                                                m
//   quasi-static  N = F_spring(x) + F_friction                                            N   (4.4)
//   with a mass   m x'' + c x' + F_spring(x) + F_friction = N                             N   (4.3)
//   load cell     F = sigma_pre(t) A + F_spring(x)                                        N
//   spring        F_spring = k x, or what the spring's ports make of it                   N
//
// At rest: with the fractions of the start, +180 where nothing else is said. A bench is set up with the
// specimen as it is then. Before time 0, in a specimen's past, the prestress has not begun to relax.
//
// With a linear spring and no terms that depend on sigma it is solved in closed form, else by the secant
// method on sigma. With a mass, N = k_act (x_free - x), x_free being x at N = 0; x follows as the oscillator
// of stiffness k_act + dF_spring/dx, exactly for x_free linear over the step.
//
// With numbers that carry tangents the root is found by Newton's method, from the stress that the caller
// gives, and gets its tangents by the implicit function theorem.
#pragma once

#include "model/physics/implicit.h"
#include "model/physics/oscillator.h"
#include "model/physics/ports.h"

namespace ferrobench::model {

template <class T>
struct Equilibrium {
  T stress = 0;        // Pa
  T displacement = 0;  // m
  T strain = 0;        // 1, active material
  T force = 0;         // N, at the load cell
};

template <class T>
class Mechanics {
 public:
  Mechanics(const ModelOf<T>& model, PortsOf<T>& ports);

  // True if stress does not depend on the material's state: nothing pushes back.
  bool stress_is_constant() const;
  void start(MaterialState<T>& at);
  // The equilibrium after `h` with fractions, field and time of `end`, whose stress and strain are filled in.
  // With tangents, the stress of `end` is where the search for the root begins.
  Equilibrium<T> propose(const T& h, MaterialState<T>& end) const;
  void accept(const T& h, MaterialState<T>& end);
  // Longest step, s, that shows the kinetics the ringing of the mass as long as it would change a rate
  // noticeably, to the tolerance of the simulation, for a field that goes on at `slew` [V/m/s]. Infinite
  // without a mass.
  double largest_step(double slew, double tolerance) const;
  // From now on down to rounding.
  void solve_tightly() { balance_ = 1e-15; }

 private:
  // Of the mass, at the last accepted step.
  struct Moving {
    MotionOf<T> motion;
    T free_extension = 0;   // m
    T steady_velocity = 0;  // m/s, that the step went towards
    T slew = 0;             // V/m/s
    MaterialState<T> material;
  };

  double balance() const;
  T mean_compliance(const MaterialState<T>& s) const;
  T strain_without_terms(const MaterialState<T>& s, const T& stress) const;
  T spring_force(const T& extension) const;
  T spring_slope(const T& extension) const;
  T prestress(const T& time) const;
  T friction_state(const T& extension) const;
  T friction(const T& extension) const;
  T strain_apart_from_stress(const T& h, const MaterialState<T>& s) const;
  Equilibrium<T> linear(const T& h, const MaterialState<T>& s) const;
  // On its own, so that those who take all of propose() into themselves do not become too large.
  [[gnu::noinline]] Equilibrium<T> general(const T& h, MaterialState<T>& end) const;
  Equilibrium<T> by_newton(const T& h, MaterialState<T>& end) const;
  // Fills in all that follows from this stress, and gives the force that is missing for balance, Pa.
  T unbalanced(const T& h, const T& stress, MaterialState<T>& end, Equilibrium<T>& out) const;
  T actuator_stiffness(const MaterialState<T>& s) const;
  T free_extension(const MaterialState<T>& s, const Equilibrium<T>& e) const;
  OscillatorOf<T> oscillator(const MaterialState<T>& s) const;
  MotionOf<T> move(const T& h, const MaterialState<T>& end, const Equilibrium<T>& e) const;
  Moving moved(const T& h, const MaterialState<T>& end, const Equilibrium<T>& e) const;

  MaterialOf<T> material_;
  ActuatorOf<T> actuator_;
  LoadOf<T> load_;
  PortsOf<T>& ports_;
  bool linear_ = true;
  double balance_ = 1e-12;  // of the stress, what may be missing for balance
  T strain_at_rest_ = 0;
  T last_extension_ = 0, friction_state_ = 0;
  std::optional<Moving> moving_;  // empty before the start, or without a mass
};

}  // namespace ferrobench::model

// The actuator against spring, passive layers, prestress and, if there is one, the mass of the stage
// (4.1-4.4).
//
//   strain        S = <s> sigma + <d> E + eps_90 x90 + terms                              1
//   active        dx_active = L (S - S_ref),  S_ref = S at rest (+180, E = 0, sigma = -sigma_pre)      m
//   push          N = -(sigma + sigma_pre(t)) A                                           N
//   displacement  x = dx_active - N / k_na                                                m
//   quasi-static  N = F_spring(x) + F_friction                                            N   (4.4)
//   with a mass   m x'' + c x' + F_spring(x) + F_friction = N                             N   (4.3)
//   load cell     F = sigma_pre(t) A + F_spring(x)                                        N
//
// With a linear spring and no terms sigma is solved in closed form, else by the secant method on sigma. With
// a mass, N = k_act (x_free - x), x_free being x at N = 0; x follows as the oscillator of stiffness k_act +
// dF_spring/dx, exactly for x_free linear over the step.
#pragma once

#include "model/physics/oscillator.h"
#include "model/physics/ports.h"

namespace ferrobench::model {

struct Equilibrium {
  double stress = 0;        // Pa
  double displacement = 0;  // m
  double strain = 0;        // 1, active material
  double force = 0;         // N, at the load cell
};

class Mechanics {
 public:
  Mechanics(const Model& model, Ports& ports);

  // True if stress does not depend on the material's state: nothing pushes back.
  bool stress_is_constant() const;
  void start(MaterialState& at);
  // The equilibrium after `h` with fractions, field and time of `end`, whose stress and strain are filled in.
  Equilibrium propose(double h, MaterialState& end) const;
  void accept(double h, MaterialState& end);
  // Longest step, s, that shows the kinetics the ringing of the mass as long as it would change a rate
  // noticeably, for a field that goes on at `slew` [V/m/s]. Infinite without a mass.
  double largest_step(double slew) const;

 private:
  // Of the mass, at the last accepted step.
  struct Moving {
    Motion motion;
    double free_extension = 0;   // m
    double steady_velocity = 0;  // m/s, that the step went towards
    double slew = 0;             // V/m/s
    MaterialState material;
  };

  double mean_compliance(const MaterialState& s) const;
  double strain_without_terms(const MaterialState& s, double stress) const;
  double spring_force(double extension) const;
  double spring_slope(double extension) const;
  double prestress(double time) const;
  double friction_state(double extension) const;
  double friction(double extension) const;
  Equilibrium linear(const MaterialState& s) const;
  Equilibrium general(double h, MaterialState& end) const;
  // Fills in all that follows from this stress, and gives the force that is missing for balance, Pa.
  double unbalanced(double h, double stress, MaterialState& end, Equilibrium& out) const;
  double actuator_stiffness(const MaterialState& s) const;
  double free_extension(const MaterialState& s, const Equilibrium& e) const;
  Oscillator oscillator(const MaterialState& s) const;
  Motion move(double h, const MaterialState& end, const Equilibrium& e) const;
  Moving moved(double h, const MaterialState& end, const Equilibrium& e) const;

  Material material_;
  Actuator actuator_;
  Load load_;
  Ports& ports_;
  bool linear_ = true;
  double strain_at_rest_ = 0;
  double last_extension_ = 0, friction_state_ = 0;
  std::optional<Moving> moving_;  // empty before the start, or without a mass
};

}  // namespace ferrobench::model

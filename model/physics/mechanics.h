// The actuator against spring, passive layers and prestress (4.1-4.4).
//
//   strain        S = <s> sigma + <d> E + eps_90 x90 + terms                        1
//   free stroke   dx_active = L (S - S_ref),  S_ref = S at rest (+180, E = 0, sigma = -sigma_pre)      m
//   quasi-static  k_na (dx_active - x) = F_spring(x) + F_friction                    N   (4.4)
//   stress        sigma = -sigma_pre - (F_spring(x) + F_friction) / A               Pa
//   load cell     F = sigma_pre A + F_spring(x)                                     N
//
// With a linear spring and no terms sigma is solved in closed form, else by Newton's method on sigma.
#pragma once

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
  // Longest step that the mechanics' own dynamics allow, s.
  double largest_step() const;

 private:
  double strain_without_terms(const MaterialState& s, double stress) const;
  double spring_force(double extension) const;
  double prestress(double time) const;
  double friction_state(double extension) const;
  Equilibrium linear(const MaterialState& s) const;
  Equilibrium general(double h, MaterialState& end) const;

  Material material_;
  Actuator actuator_;
  Load load_;
  Ports& ports_;
  bool linear_ = true;
  double strain_at_rest_ = 0;
  double last_extension_ = 0, friction_state_ = 0;
};

}  // namespace ferrobench::model

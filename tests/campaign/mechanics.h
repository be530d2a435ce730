// The twin's strain, mechanics and polarization at given fractions.
#pragma once

#include <array>

#include "tests/campaign/terms.h"

namespace ferrobench::campaign {

// Everything the twin remembers from step to step, except the single domains.
struct State {
  double time = 0;                  // s
  double monitor = 0, field = 0;    // V/m, at the amplifier and across the material
  double plus = 1, minus = 0;       // mean fractions
  double stress = 0;                // Pa
  double settled_stress = 0;        // Pa, without the mass
  double settled_displacement = 0;  // m
  double displacement = 0;          // m
  double velocity = 0;              // m/s, of the mass
  double instant_strain = 0;        // since rest
  std::array<double, 5> creep{};    // delayed strains
  double heat = 0, viscous = 0;
  double friction = 0, direction = 0;  // Dahl's states
  double switched = 0;                 // integral |dP_irr|, C/m^2
  double conducted = 0;                // C/m^2
  double order() const { return plus - minus; }
  double ninety() const { return 1 - plus - minus; }
};

class Mechanics {
 public:
  Mechanics(const model::Model& model, const Terms& terms) : m_(model), t_(terms) {}

  // The zero of the displacement is the specimen at rest in this state, without field.
  void rest_in(const State& state);
  // Fills in all of `to` that follows from its fractions, field and time, h seconds after `from`.
  void settle(const State& from, State& to, double h) const;
  double force(const State& s) const;         // N, load cell
  double polarization(const State& s) const;  // C/m^2
  double remanent(const State& s) const;      // P_+ as worn so far
  double period() const;                      // s, of the mass; 0 without
  const Terms& terms() const { return t_; }
  const model::Model& model() const { return m_; }

 private:
  struct Parts;
  Parts parts(const State& from, const State& to, double h, double stress) const;
  double balanced_stress(const State& from, const State& to, double h, double target) const;
  double prestress(double time) const;
  double spring(double x, double direction) const;
  double compliance(const State& s) const;
  double stiffness(const State& s) const;
  double free_extension(const State& s) const;
  void swing(const State& from, State& to, double h) const;

  model::Model m_;
  Terms t_;
  double rest_strain_ = 0;
};

}  // namespace ferrobench::campaign

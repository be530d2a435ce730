// Parameters that enter linearly, eliminated by least squares (variable projection: G. H. Golub and V.
// Pereyra, SIAM J. Numer. Anal. 10 (1973) 413).
//
// For a specimen that nothing pushes against, the phase fractions x+, x-, x90 depend on six of the model's
// parameters only through the groups
//
//   V P,   barrier / P,   s_std |eps_90| / P,   rho = (kappa_180 - kappa_90) / P
//
// and c P of an effect by which the rates see a field c times the polarization or its rate,
// with P = P_r the remanent polarization, V the activation volume and s_std the spread of interaction
// stresses (4.16 to 4.24: a driving force over kT). With the fractions known,
//
//   charge        n A [ P (x+ - x- + rho (1 - x90) E) + kappa_90 E ] + offset  linear in P, kappa_90
//   displacement  L [ eps_90 x90 + d (x+ - x-) E ] + offset                    linear in eps_90, d
//
// so a search has four dimensions less, and each of its points has the best of these four. What is left out,
// the piezoelectric coefficient and the compliances acting on interaction stresses, is small; the solver that
// follows takes all parameters as they are.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "model/inference/residuals/residual_model.h"

namespace ferrobench::model {

class Separable {
 public:
  virtual ~Separable() = default;
  // Of the unit cube that is left to be searched.
  virtual std::size_t dimensions() const = 0;
  struct Point {
    Model model;
    double squares = 0;  // sum of squared residuals, linear parameters at their best
  };
  // Empty where the model could not be simulated. Throws Error(cancelled).
  virtual std::optional<Point> at(std::span<const double> unit, const Fidelity& fidelity) const = 0;
  // Where a model lies in the cube: where a search may begin.
  virtual std::vector<double> place(const Model& model) const = 0;
};

}  // namespace ferrobench::model

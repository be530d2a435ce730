// The maximum of a hypothesis' posterior: least squares of whitened residuals r and of what is known
// beforehand. It minimizes -2 ln posterior, which is up to a constant
//
//   S(z) = |r(z)|^2 + sum over parameters with a prior of z_i^2
//
// by Levenberg-Marquardt (Nocedal and Wright, Numerical Optimization, ch. 10) with the residuals' exact
// slopes, each step between the ends of the parameters' ranges (solver/bounded_quadratic.h). Steps bend as
// the valley does (geodesic acceleration: Transtrum and Sethna, arXiv:1201.5885): with J the slopes and K the
// second derivative along a step s, from one simulation ahead,
//
//   z(t) = z + t s - t^2 (J^T J + damping)^-1 J^T K / 2,   with the t where |r + t J s + t^2 ...|^2 is least
#pragma once

#include <Eigen/Dense>
#include <functional>
#include <limits>

#include "model/inference/residuals/whitened_residuals.h"

namespace ferrobench::model::inference {

struct Fit {
  Hypothesis hypothesis;
  Eigen::VectorXd z;
  Eigen::VectorXd residual;  // whitened, at z, with the fidelity correction
  // What a finer simulation gives less what the residuals' own gives, near z. It is added to every residual;
  // empty: there is none (solver/multifidelity.h).
  Eigen::VectorXd fidelity_correction;
  Eigen::MatrixXd jacobian;               // of the residual, at or near z
  std::vector<Eigen::Index> groups = {};  // of the residual's rows (WhitenedResiduals::groups)
  double squares = 0;                     // of residual and priors
  bool fresh = false;                     // the Jacobian was made at z

  Eigen::MatrixXd normal() const;    // J^T J and the priors' precision: the information matrix
  Eigen::VectorXd gradient() const;  // half of that of `squares`
  // Whether `squares` may come down to `wanted` if it falls by so many times what a Gauss-Newton step
  // promises.
  bool may_reach(double wanted, double trusted_decrease) const;
  double predicted_decrease() const;  // of `squares` by a full Gauss-Newton step, were the residual linear
  Eigen::VectorXd corrected(Eigen::VectorXd simulated) const;
};

// Sum of z_i^2 over the parameters that have a prior.
double prior_squares(const Hypothesis& hypothesis, const Eigen::VectorXd& z);

struct SolverOptions {
  int iterations = 12;
  // The solution has ended once less than this of the sum of squares, or less than 1e-4 of what was gained
  // before, is predicted to be gained.
  double enough = 0.5;
  // The solution is given up where it would not come below this if it gained `trusted_decrease` times what a
  // Gauss-Newton step promises.
  double wanted = std::numeric_limits<double>::infinity();
  double trusted_decrease = 3;
  double damping = 1e-3;  // of the first step, relative to the diagonal; falls where steps keep their promise
  std::function<void()> tick;  // called before each step; may throw
};

// The minimum from z on. `warm_start`, if not null, is a fit whose fidelity correction is used, and whose
// Jacobian stands for the first columns of the first step if it has fewer, or is the fit's own if it is
// fresh.
Fit minimize(const WhitenedResiduals& residuals, const Hypothesis& hypothesis, const Eigen::VectorXd& z,
             const SolverOptions& options, const Fit* warm_start = nullptr);
// The minimum from a fit's z on. Its residual, and its Jacobian if that is fresh, must be what these
// residuals give there: neither is made again.
Fit minimize(const WhitenedResiduals& residuals, Fit from, const SolverOptions& options);
// Makes the Jacobian anew at the fit's z. False if slopes cannot be had there: it is that of where it was
// made last then, or zero.
bool refresh_jacobian(const WhitenedResiduals& residuals, Fit& fit);

}  // namespace ferrobench::model::inference

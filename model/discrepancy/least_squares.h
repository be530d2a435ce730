// Fitting a hypothesis: Levenberg-Marquardt on whitened residuals and priors. The Jacobian is made of
// differences, once, and kept up by Broyden's updates until it no longer helps. Steps bend as the valley does
// (geodesic acceleration: Transtrum & Sethna, arXiv:1201.5885): with J of the slopes, K of the second
// derivative along a step s, both measured on either side of the fit,
//
//   z(t) = z + t s - t^2 (J^T J + damping)^-1 J^T K / 2,   t where |r + t J s + t^2 ...|^2 is least
#pragma once

#include "model/discrepancy/misfit.h"

namespace ferrobench::model::discrepancy {

struct Fit {
  Hypothesis hypothesis;
  Eigen::VectorXd z;
  Eigen::VectorXd residual;  // whitened, at z, correction included
  // What a finer simulation gives less what the misfit's gives, near z: added to every residual. Empty: none.
  Eigen::VectorXd correction;
  Eigen::MatrixXd jacobian;  // of the residual, at or near z
  double squares = 0;        // of residual and priors: -2 ln posterior
  bool fresh = false;        // the jacobian was made at z

  Eigen::MatrixXd normal() const;  // J^T J and the priors' precision
  Eigen::VectorXd gradient() const;
  double prospect() const;  // what is to be gained of the squares, were the residual linear
  Eigen::VectorXd corrected(Eigen::VectorXd simulated) const;
};

struct FitLimits {
  int iterations = 12;
  int refreshes = 2;     // full Jacobians, at most
  double enough = 0.5;   // a smaller gain, or a smaller share than 1e-4 of what was gained, with no more than
                         // ten times that in prospect, ends it
  bool roughly = false;  // Jacobians from one side, at half the cost: where minima are only looked for
  double damping = 1e-3;  // of the first step, a share of the diagonal; less where steps keep their promise
  std::function<void()> tick;  // called after each simulation round; may throw
};

// From z. `like`: a fit whose correction is used and whose Jacobian is known to hold for the first columns.
Fit fit(const Misfit& misfit, const Hypothesis& hypothesis, const Eigen::VectorXd& z, const FitLimits& limits,
        const Fit* like = nullptr);
// Doubles the domains of the fine simulation, to `most` at most, until no verdict would notice how far two
// lattices of them differ at z.
struct Refined {
  Eigen::VectorXd residual;  // by it, at z
  double error = 0;          // rms over the noise
};
Refined refine(Misfit& fine, const Hypothesis& hypothesis, const Eigen::VectorXd& z, int most);
// Makes the correction anew at the fit's z, where the fine simulation gives `exact`.
void correct(const Misfit& misfit, Eigen::VectorXd exact, Fit& fit);
void correct(const Misfit& misfit, const Misfit& fine, Fit& fit);
// On from where a corrected fit stands until it ends where the fine simulation has its minimum; the Jacobian
// was made close by then, the residual is that of the fine simulation.
void settle(const Misfit& misfit, Misfit& fine, Fit& fit, const std::function<void()>& tick);
// Makes the Jacobian anew at the fit's z; `roughly` as in FitLimits.
void refresh(const Misfit& misfit, Fit& fit, bool roughly = false);

// The part of the sum of squares that a change `r` of the residual leaves once all coordinates have followed:
//   drop(a r) = 2 a along - a^2 across
struct Drop {
  double along = 0;   // -(r . e) without what the coordinates take up
  double across = 0;  // (r . r) likewise
  double at(double a) const { return 2 * a * along - a * a * across; }
};
class Projection {
 public:
  explicit Projection(const Fit& fit);
  Drop drop(const Eigen::VectorXd& r) const;
  // r without what the coordinates take up, as the coefficients that they would take.
  Eigen::VectorXd taken(const Eigen::VectorXd& r) const;

 private:
  const Fit& fit_;
  Eigen::LDLT<Eigen::MatrixXd> factor_;
  Eigen::VectorXd gradient_;
};

}  // namespace ferrobench::model::discrepancy

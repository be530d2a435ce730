// Two fidelities of one simulation: the coarse one makes slopes and most steps, the fine one says where the
// minimum is. Near z_0 the difference between them hardly depends on the parameters, so a fit minimizes
//
//   r_coarse(z) + c,   c = r_fine(z_0) - r_coarse(z_0)
//
// and c, the additive fidelity correction, is made anew where it ends (variable-fidelity model
// management: Alexandrov et al., J. Aircraft 38 (2001) 1093).
#pragma once

#include "model/inference/solver/gauss_newton.h"

namespace ferrobench::model::inference {

// A verdict does not notice a change of the sum of squares of this size, where 60 or more count as a
// detection.
inline constexpr double unnoticed_change = 12;
// Nodes that a fine simulation has at least.
inline constexpr int least_fine_domains = 1000;

struct ConvergedFidelity {
  Eigen::VectorXd residual;  // by the fine simulation, at z
  double error = 0;          // its own, root mean square in standard deviations of the noise
};
// Doubles the nodes of the fine simulation, to `most_domains` at most, until two shifts of its lattice give
// residuals at z that no verdict would tell apart, or whose error's root mean square is below `most_error`.
// If it is anchored, so far away that its error shows here, the anchor is moved to z.
ConvergedFidelity converge_fine_fidelity(WhitenedResiduals& fine, const Hypothesis& hypothesis,
                                         const Eigen::VectorXd& z, int most_domains, double most_error = 0);
// Anchors the fine simulation at z, where it gives `residual`, and goes on with fewer nodes: explanations are
// compared with each other, and what the lattice adds to all of them alike is no part of that.
void anchor_fine_fidelity(WhitenedResiduals& fine, const Hypothesis& hypothesis, const Eigen::VectorXd& z,
                          Eigen::VectorXd residual);
// Largest root mean squares, in standard deviations of noise and model error together, by which the coarse
// simulation may differ from the fine one, and the fine one from the truth.
struct AllowedError {
  double coarse = 0;
  double fine = 0;  // beyond what no verdict would notice
};
// Only the change of the difference with z counts, a tenth to a third of it on benches of the campaign. 250
// domains differ by twenty where the noise is 0.01 % of the range, and with them the same effects came out
// best.
inline constexpr AllowedError if_corrected{.coarse = 20};
// Parameters move farther in a model that is wrong, and the correction changes more. On loops of a bulk
// ceramic at 800 V, 250 domains were 8 % of the range off where the model missed by 3 %; without a correction
// the terms that were found explained the error of the sum. The fine one's own error is small beside the
// model's at a tenth: with 0.04, by `unnoticed_change` alone, the ceramic asked for 16,000 domains.
inline constexpr AllowedError beside_model_error{.coarse = 1, .fine = 0.1};
// Of what makes a fit's last steps: a sum over few domains has local minima of its own, which stop them.
inline constexpr double last_steps_error = 0.8;
// Makes `fine` fine enough for the model at z (converge_fine_fidelity), and `coarse` the cheapest simulation
// that differs from it by no more than is allowed there; chooses what makes the fine one's last steps as
// well.
ConvergedFidelity choose_fidelities(WhitenedResiduals& coarse, WhitenedResiduals& fine,
                                    const Hypothesis& hypothesis, const Eigen::VectorXd& z, int most_domains,
                                    const AllowedError& allowed = if_corrected);
// Root mean square of the difference between the coarse residuals at z and `exact`.
double coarse_error_at(const WhitenedResiduals& coarse, const Eigen::VectorXd& exact,
                       const Hypothesis& hypothesis, const Eigen::VectorXd& z);

// Makes the correction anew at the fit's z, where the fine simulation gives `exact`.
void apply_fidelity_correction(const WhitenedResiduals& coarse, Eigen::VectorXd exact, Fit& fit);
void apply_fidelity_correction(const WhitenedResiduals& coarse, const WhitenedResiduals& fine, Fit& fit);

// Takes a fit to the minimum of the fine simulation with steps by the coarse one: the correction is made anew
// where each solution ends, until that gains nothing. The fit's residual is the fine simulation's then. The
// grain of the coarse sum may stop it before: 0 to 20 above that minimum by 250 domains, less than 1 by 500.
void minimize_corrected(const WhitenedResiduals& coarse, const WhitenedResiduals& fine, Fit& fit,
                        const SolverOptions& options);
// The same where it is known that the fine simulation gives `exact` at the fit's z.
void minimize_corrected(const WhitenedResiduals& coarse, const WhitenedResiduals& fine, Eigen::VectorXd exact,
                        Fit& fit, const SolverOptions& options);

enum class LastSteps {
  cheap,  // by `last_steps` of the fine simulation
  fine    // and then by the fine simulation itself
};
// Takes a corrected fit on to the minimum of the fine simulation. Its residual is that of the fine simulation
// then, corrected from the coarse one, and its Jacobian was made close by. Along directions that only priors
// hold, the grain of fewer nodes can carry a fit off by several of their standard deviations.
void refine(const WhitenedResiduals& coarse, WhitenedResiduals& fine, Fit& fit, LastSteps by,
            const std::function<void()>& tick);
// Takes a fit to the minimum of the coarse simulation, corrected to the fine one where it stood, and anchors
// the fine simulation where that is. Its Jacobian was made there.
void anchor_corrected(const WhitenedResiduals& coarse, WhitenedResiduals& fine, Fit& fit,
                      const std::function<void()>& tick);
// Takes a fit at which the fine simulation is anchored on by the fine simulation itself: where it ends so far
// from the anchor that a verdict might notice, the anchor is moved there and the fit goes on.
void refine_around_anchor(const WhitenedResiduals& coarse, WhitenedResiduals& fine, Fit& fit,
                          const std::function<void()>& tick);

}  // namespace ferrobench::model::inference

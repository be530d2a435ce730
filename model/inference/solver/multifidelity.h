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

struct ConvergedFidelity {
  Eigen::VectorXd residual;  // by the fine simulation, at z
  double error = 0;          // its own, root mean square in standard deviations of the noise
};
// Doubles the nodes of the fine simulation, to `most_domains` at most, until two shifts of its lattice give
// residuals at z that no verdict would tell apart.
ConvergedFidelity converge_fine_fidelity(WhitenedResiduals& fine, const Hypothesis& hypothesis,
                                         const Eigen::VectorXd& z, int most_domains);
// Root mean square by which the coarse simulation may differ from the fine one, in standard deviations of
// noise and model error together. Where a correction takes most of the difference out it need only stay below
// the noise. Where none is made it has to be small beside the model's error: on loops of a bulk ceramic at
// 800 V, 250 domains were 8 % of the range off where the model missed by 3, and terms were found that
// explained the grain of their sum.
inline constexpr double coarse_error_if_corrected = 0.8, coarse_error_alone = 0.2;
// Makes `fine` fine enough for the model at z, and `coarse` the cheapest simulation that differs from it by
// no more than `coarse_error`. Returns the fine one's own error, as above.
double choose_fidelities(WhitenedResiduals& coarse, WhitenedResiduals& fine, const Hypothesis& hypothesis,
                         const Eigen::VectorXd& z, int most_domains,
                         double coarse_error = coarse_error_if_corrected);
// Root mean square of their difference at z.
double difference_of_fidelities(const WhitenedResiduals& coarse, const WhitenedResiduals& fine,
                                const Hypothesis& hypothesis, const Eigen::VectorXd& z);

// Makes the correction anew at the fit's z, where the fine simulation gives `exact`.
void apply_fidelity_correction(const WhitenedResiduals& coarse, Eigen::VectorXd exact, Fit& fit);
void apply_fidelity_correction(const WhitenedResiduals& coarse, const WhitenedResiduals& fine, Fit& fit);

// Takes a corrected fit on to the minimum of the fine simulation. Its residual is that of the fine simulation
// then, and its Jacobian was made close by.
void refine(const WhitenedResiduals& coarse, const WhitenedResiduals& fine, Fit& fit,
            const std::function<void()>& tick);

}  // namespace ferrobench::model::inference

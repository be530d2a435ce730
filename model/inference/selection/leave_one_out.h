// What a fit says of a recording that it did not see: each is left out in turn.
//
// One Gauss-Newton step from the fit of all,
//   z_r = z - (A - J_r^T J_r)^-1 (g - J_r^T e_r),   A = J^T J + priors, g = J^T e + priors,
// and the residual that follows, e_r + J_r (z_r - z). Its error is that of the linear step.
#pragma once

#include <vector>

#include "model/inference/residuals/whitened_recordings.h"
#include "model/inference/selection/explanation.h"
#include "model/inference/solver/gauss_newton.h"

namespace ferrobench::model::inference {

// Sums of squares of the residuals, by position in residuals.chosen().
std::vector<double> leave_one_out_squares(const WhitenedRecordings& residuals, const Fit& fit);

// How a fit does on each that is left out, beside one whose squares are `without`.
LeaveOneOut compare_left_out(const WhitenedRecordings& residuals, const std::vector<double>& without,
                             const Fit& with);

}  // namespace ferrobench::model::inference

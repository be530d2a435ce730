// How sure a fit's parameters are, and which errors go together.
//
// With J_p the slopes of a part's residuals, s_p^2 their variance and t_p the number of rows over which they
// stay correlated. Of a recording, s_p^2 is the residuals' mean square and t_p their integrated
// autocorrelation; of residuals counted in standard deviations, the cells of a table, s_p^2 is 1, or their
// mean square if that is larger, and t_p 1.
//
//   A = sum over parts of J_p^T J_p / s_p^2 + 12 I
//   C = A^-1 (sum over parts of t_p J_p^T J_p / s_p^2 + 12 I) A^-1
//
// the covariance of a model that is not exactly true (P. J. Huber 1967, H. White 1982). The term 12 I is the
// information in a uniform distribution over the unit interval: what the data do not determine stays within
// its range.
#pragma once

#include <Eigen/Dense>
#include <vector>

#include "model/inference/residuals/residual_model.h"

namespace ferrobench::model {

// t: 1 + 2 times the sum of the autocorrelation of the residuals up to its first zero.
double correlated_rows(const Eigen::Ref<const Eigen::VectorXd>& residuals);

// Of the unit coordinates, by the residuals and their slopes at the minimum.
Eigen::MatrixXd covariance(const std::vector<ResidualPart>& parts, const Eigen::VectorXd& residuals,
                           const Eigen::MatrixXd& slopes);

// What a model that is not exactly true adds to the covariance of its parameters, by how far groups of rows
// disagree on them: with A the information, J_g the slopes and r_g the residuals of group g, whitened,
//
//   A^-1 (sum over groups of s_g s_g^T) A^-1,   s_g = J_g^T (I - J_g A^-1 J_g^T)^-1/2 r_g
//
// the covariance that is robust to what rows of a group have in common (Liang and Zeger, Biometrika 73 (1986)
// 13), without the bias that comes of the groups having taken part in the fit (Bell and McCaffrey, Survey
// Methodology 28 (2002) 169). `groups` are the first rows of each; zero if there is none, or if the
// information, which may contain that of a prior, is not positive definite.
Eigen::MatrixXd disagreement_of_groups(const std::vector<Eigen::Index>& groups,
                                       const Eigen::VectorXd& residuals, const Eigen::MatrixXd& slopes,
                                       const Eigen::MatrixXd& information);

}  // namespace ferrobench::model

// The minimum of a strictly convex quadratic between bounds,
//
//   min over d of  g^T d + d^T A d / 2,   low_i <= d_i <= high_i
//
// by an active set (Nocedal and Wright, Numerical Optimization, algorithm 16.3). A step of least squares that
// is cut off at a bound afterwards is not that minimum: the others have moved to make up for what was cut.
#pragma once

#include <Eigen/Dense>

namespace ferrobench::model::inference {

// `a`: symmetric and positive definite. Zero must lie between the bounds.
Eigen::VectorXd bounded_minimum(const Eigen::MatrixXd& a, const Eigen::VectorXd& g,
                                const Eigen::VectorXd& low, const Eigen::VectorXd& high);

}  // namespace ferrobench::model::inference

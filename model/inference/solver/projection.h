// What is left of a change of the residuals once all parameters of a fit have followed it: the score test of
// an added variable (C. R. Rao 1948; in linear regression, Frisch and Waugh 1933).
//
// Let J be the Jacobian, A = J^T J + priors the information matrix, e the residual and g = J^T e + priors the
// gradient. If the residual changes by a times r, the sum of squares falls by
//
//   drop(a) = 2 a along - a^2 across
//   along   = -(r.e - g^T A^-1 J^T r)
//   across  = r.r - (J^T r)^T A^-1 (J^T r)
#pragma once

#include "model/inference/solver/gauss_newton.h"

namespace ferrobench::model::inference {

struct Drop {
  double along = 0, across = 0;
  double at(double a) const { return 2 * a * along - a * a * across; }
};

class Projection {
 public:
  // `fit` must have a Jacobian and outlive this.
  explicit Projection(const Fit& fit);
  Drop drop(const Eigen::VectorXd& r) const;
  // How far the parameters go to take r up as far as they can: A^-1 J^T r.
  Eigen::VectorXd taken(const Eigen::VectorXd& r) const;

 private:
  const Fit& fit_;
  Eigen::LDLT<Eigen::MatrixXd> factor_;
  Eigen::VectorXd gradient_;
};

}  // namespace ferrobench::model::inference

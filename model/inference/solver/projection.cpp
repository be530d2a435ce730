#include "model/inference/solver/projection.h"

#include <algorithm>

namespace ferrobench::model::inference {

Projection::Projection(const Fit& fit) : fit_(fit), factor_(fit.normal()), gradient_(fit.gradient()) {}

Eigen::VectorXd Projection::taken(const Eigen::VectorXd& r) const {
  return factor_.solve(fit_.jacobian.transpose() * r);
}

Drop Projection::drop(const Eigen::VectorXd& r) const {
  const Eigen::VectorXd shared = fit_.jacobian.transpose() * r;
  const Eigen::VectorXd solved = factor_.solve(shared);
  return {.along = -(r.dot(fit_.residual) - gradient_.dot(solved)),
          .across = std::max(0.0, r.squaredNorm() - shared.dot(solved))};
}

}  // namespace ferrobench::model::inference

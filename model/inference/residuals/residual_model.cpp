#include "model/inference/residuals/residual_model.h"

#include "model/inference/residuals/separable.h"

namespace ferrobench::model {

double sum_of_squares(std::span<const double> r) {
  double sum = 0;
  for (const double v : r) sum += v * v;
  return sum;
}

Solved ResidualModel::evaluate_with_slopes(const Model&, const Fidelity&, const std::vector<FreeParameter>&,
                                           std::span<double>, Eigen::MatrixXd&) const {
  return Solved::no;
}

std::unique_ptr<Separable> ResidualModel::separable(const Model&, const std::vector<FreeParameter>&) const {
  return nullptr;
}

}  // namespace ferrobench::model

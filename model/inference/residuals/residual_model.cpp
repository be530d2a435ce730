#include "model/inference/residuals/residual_model.h"

#include <algorithm>
#include <cmath>

#include "model/inference/residuals/separable.h"

namespace ferrobench::model {

double sum_of_squares(std::span<const double> r) {
  double sum = 0;
  for (const double v : r) sum += v * v;
  return sum;
}

Solved ResidualModel::evaluate(const Model& model, const Fidelity& fidelity, std::span<double> out) const {
  if (fill(model, fidelity, {}, out, nullptr) == Solved::no) return Solved::no;
  return std::ranges::all_of(out, [](double r) { return std::isfinite(r); }) ? Solved::yes : Solved::no;
}

Solved ResidualModel::evaluate_with_slopes(const Model& model, const Fidelity& fidelity,
                                           const std::vector<FreeParameter>& by, std::span<double> out,
                                           Eigen::MatrixXd& slopes) const {
  slopes.setZero(static_cast<Eigen::Index>(size_), static_cast<Eigen::Index>(by.size()));
  if (fill(model, fidelity, by, out, &slopes) == Solved::no) return Solved::no;
  const bool finite =
      std::ranges::all_of(out, [](double r) { return std::isfinite(r); }) && slopes.allFinite();
  return finite ? Solved::yes : Solved::no;
}

std::unique_ptr<Separable> ResidualModel::separable(const Model&, const std::vector<FreeParameter>&) const {
  return nullptr;
}

}  // namespace ferrobench::model

#include "model/inference/solver/least_squares.h"

#include <ceres/ceres.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <exception>
#include <limits>

namespace ferrobench::model {
namespace {

class Cost final : public ceres::CostFunction {
 public:
  Cost(std::size_t residuals, std::size_t parameters, const ResidualFunction& function,
       const LeastSquaresOptions& options, std::exception_ptr& thrown)
      : function_(function), options_(options), thrown_(thrown) {
    set_num_residuals(static_cast<int>(residuals));
    mutable_parameter_block_sizes()->push_back(static_cast<int>(parameters));
  }

  // Exceptions do not travel through the solver: they end it, and are thrown again behind it.
  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override {
    if (thrown_) return false;
    try {
      const auto rows = static_cast<std::size_t>(num_residuals());
      const std::span<const double> at(parameters[0], static_cast<std::size_t>(parameter_block_sizes()[0]));
      const bool wanted = jacobians != nullptr && jacobians[0] != nullptr;
      Eigen::MatrixXd slopes;
      const bool exact = wanted && options_.slopes && options_.slopes(at, {residuals, rows}, slopes);
      if (!exact && !function_(at, {residuals, rows})) return false;
      if (!wanted) return true;
      const Eigen::Map<Eigen::VectorXd> middle(residuals, num_residuals());
      if (!exact) slopes = jacobian(middle, at, function_, options_.difference);
      Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>(
          jacobians[0], slopes.rows(), slopes.cols()) = slopes;
      return true;
    } catch (...) {
      thrown_ = std::current_exception();
      return false;
    }
  }

 private:
  const ResidualFunction& function_;
  const LeastSquaresOptions& options_;
  std::exception_ptr& thrown_;
};

class Follow final : public ceres::IterationCallback {
 public:
  Follow(const LeastSquaresOptions& options, const std::vector<double>& at) : options_(options), at_(at) {}
  ceres::CallbackReturnType operator()(const ceres::IterationSummary& s) override {
    if (s.step_is_successful && options_.progress) options_.progress(2 * s.cost, at_);
    return ceres::SOLVER_CONTINUE;
  }

 private:
  const LeastSquaresOptions& options_;
  const std::vector<double>& at_;
};

}  // namespace

Eigen::MatrixXd jacobian(const Eigen::VectorXd& middle, std::span<const double> at,
                         const ResidualFunction& function, double difference) {
  Eigen::MatrixXd out(middle.size(), static_cast<Eigen::Index>(at.size()));
  tbb::parallel_for(std::size_t{0}, at.size(), [&](std::size_t i) {
    std::array<Eigen::VectorXd, 2> side{middle, middle};
    std::array<double, 2> place{at[i], at[i]};
    for (std::size_t k = 0; k < 2; ++k) {
      std::vector<double> moved(at.begin(), at.end());
      moved[i] = std::clamp(at[i] + (k == 0 ? -difference : difference), 0.0, 1.0);
      if (moved[i] == at[i]) continue;
      Eigen::VectorXd r(middle.size());
      if (!function(moved, {r.data(), static_cast<std::size_t>(r.size())})) continue;
      side[k] = r;
      place[k] = moved[i];
    }
    auto column = out.col(static_cast<Eigen::Index>(i));
    if (place[1] > place[0])
      column = (side[1] - side[0]) / (place[1] - place[0]);
    else
      column.setZero();
  });
  return out;
}

LeastSquaresResult least_squares(std::size_t residuals, const std::vector<double>& start,
                                 const ResidualFunction& function, const LeastSquaresOptions& options) {
  LeastSquaresResult out{.at = start, .squares = std::numeric_limits<double>::infinity()};
  if (std::vector<double> first(residuals); !function(start, first))
    return out;  // where Ceres would complain to the standard error output
  std::exception_ptr thrown;
  ceres::Problem problem;
  problem.AddResidualBlock(new Cost(residuals, start.size(), function, options, thrown), nullptr,
                           out.at.data());
  for (int i = 0; i < static_cast<int>(start.size()); ++i) {
    problem.SetParameterLowerBound(out.at.data(), i, 0);
    problem.SetParameterUpperBound(out.at.data(), i, 1);
  }
  Follow follow(options, out.at);
  ceres::Solver::Options solver;
  solver.max_num_iterations = options.iterations;
  solver.function_tolerance = options.tolerance;
  solver.logging_type = ceres::SILENT;
  solver.update_state_every_iteration = true;
  solver.callbacks.push_back(&follow);
  ceres::Solver::Summary summary;
  ceres::Solve(solver, &problem, &summary);
  if (thrown) std::rethrow_exception(thrown);
  if (!summary.iterations.empty()) out.squares = 2 * summary.final_cost;
  return out;
}

}  // namespace ferrobench::model

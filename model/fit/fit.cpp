#include "model/fit/fit.h"

#include <ceres/ceres.h>

#include <cmath>
#include <limits>
#include <random>

namespace ferrobench::model {
namespace {

constexpr double far = 7;  // end of the logistic scale: within 0.1 % of a bound

Model model_at(const Model& base, const std::vector<FreeParameter>& free, const double* z) {
  std::vector<std::pair<std::string, double>> values;
  for (std::size_t i = 0; i < free.size(); ++i) values.emplace_back(free[i].path, from_search(free[i], z[i]));
  return with_parameters(base, values);
}

struct Cost {
  const Model& base;
  const FitTarget& target;
  const FitOptions& options;
  int& simulations;
  FitProgress& progress;
  bool& stopped;

  // False, which ends the solver, once the caller wants no more; the first is always made.
  bool operator()(double const* const* z, double* out) const {
    const std::span<double> residuals(out, target.size());
    stopped = stopped || (simulations > 0 && options.progress && !options.progress(progress));
    if (stopped) return false;
    try {
      ++simulations;
      target.residuals(model_at(base, options.free, z[0]), options.simulation, residuals);
    } catch (const Error& e) {
      if (e.code() == ErrorCode::cancelled) {
        stopped = true;
        return false;
      }
      // Parameters for which the model cannot be solved are no place to go to.
      std::fill(residuals.begin(), residuals.end(), 1e3);
    }
    for (double& r : residuals)
      if (!std::isfinite(r)) r = 1e3;
    return true;
  }
};

// Keeps the best of a start as it goes, so that a start that is stopped is not lost.
class Watch final : public ceres::IterationCallback {
 public:
  Watch(const FitOptions& options, FitProgress& progress, const std::vector<double>& z)
      : options_(options), progress_(progress), z_(z) {}
  ceres::CallbackReturnType operator()(const ceres::IterationSummary& s) override {
    progress_.fraction =
        (progress_.start + static_cast<double>(s.iteration) / options_.iterations) / progress_.starts;
    if (s.step_is_successful || s.iteration == 0) {
      reached = 2 * s.cost;
      best = z_;
    }
    return ceres::SOLVER_CONTINUE;
  }
  double reached = std::numeric_limits<double>::infinity();
  std::vector<double> best;

 private:
  const FitOptions& options_;
  FitProgress& progress_;
  const std::vector<double>& z_;
};

std::vector<double> standard_deviations(ceres::Problem& problem, const double* z, std::size_t n,
                                        double variance) {
  ceres::Covariance::Options options;
  options.algorithm_type = ceres::DENSE_SVD;
  options.null_space_rank = -1;
  ceres::Covariance covariance(options);
  std::vector<double> matrix(n * n), out(n, 0.0);
  const std::vector<std::pair<const double*, const double*>> blocks{{z, z}};
  if (!covariance.Compute(blocks, &problem) || !covariance.GetCovarianceBlock(z, z, matrix.data()))
    return out;
  for (std::size_t i = 0; i < n; ++i) out[i] = std::sqrt(std::max(0.0, variance * matrix[i * n + i]));
  return out;
}

}  // namespace

FitResult fit(const Model& start, const FitTarget& target, const FitOptions& options) {
  const std::size_t n = options.free.size();
  if (n == 0) throw Error(ErrorCode::invalid_params, "a fit needs at least one free parameter");
  FitResult result{.model = start,
                   .parameters = {},
                   .cost_before = 0,
                   .cost_after = 0,
                   .simulations = 0,
                   .stopped = false};

  std::vector<double> first(n);
  for (std::size_t i = 0; i < n; ++i)
    first[i] = std::clamp(to_search(options.free[i], get_parameter(start, options.free[i].path)), -far, far);

  FitProgress progress{.start = 0, .starts = std::max(1, options.starts), .fraction = 0, .cost = 0};
  const auto make_cost = [&] {
    return new Cost{start, target, options, result.simulations, progress, result.stopped};
  };
  const auto squares = [&](const std::vector<double>& z) {
    std::vector<double> residuals(target.size());
    const double* at = z.data();
    (*std::unique_ptr<Cost>(make_cost()))(&at, residuals.data());
    double sum = 0;
    for (const double r : residuals) sum += r * r;
    return sum;
  };
  result.cost_before = result.cost_after = progress.cost = squares(first);
  if (result.stopped)
    throw Error(ErrorCode::cancelled, "the fit was stopped before its first simulation ended");

  std::mt19937_64 random(options.seed);
  std::normal_distribution<double> normal;
  std::vector<double> best = first, spread(n, 0.0);
  for (; progress.start < progress.starts && !result.stopped; ++progress.start) {
    std::vector<double> z = best;
    if (progress.start > 0)
      for (double& value : z) value = std::clamp(value + options.spread * normal(random), -far, far);
    ceres::NumericDiffOptions differences;
    differences.relative_step_size = 3e-3;
    auto* cost = new ceres::DynamicNumericDiffCostFunction<Cost, ceres::CENTRAL>(
        make_cost(), ceres::TAKE_OWNERSHIP, differences);
    cost->AddParameterBlock(static_cast<int>(n));
    cost->SetNumResiduals(static_cast<int>(target.size()));
    ceres::Problem problem;
    problem.AddResidualBlock(cost, nullptr, z.data());
    for (std::size_t i = 0; i < n; ++i) {
      problem.SetParameterLowerBound(z.data(), static_cast<int>(i), -far);
      problem.SetParameterUpperBound(z.data(), static_cast<int>(i), far);
    }
    Watch watch(options, progress, z);
    ceres::Solver::Options solver;
    solver.max_num_iterations = options.iterations;
    solver.function_tolerance = 1e-5;
    solver.logging_type = ceres::SILENT;
    solver.update_state_every_iteration = true;
    solver.callbacks.push_back(&watch);
    ceres::Solver::Summary summary;
    ceres::Solve(solver, &problem, &summary);
    if (watch.reached < result.cost_after) {
      result.cost_after = progress.cost = watch.reached;
      best = watch.best;
      const auto freedom = std::max<double>(1, static_cast<double>(target.size()) - static_cast<double>(n));
      if (!result.stopped) spread = standard_deviations(problem, z.data(), n, watch.reached / freedom);
    }
  }

  result.model = model_at(start, options.free, best.data());
  for (std::size_t i = 0; i < n; ++i) {
    const auto& p = options.free[i];
    const double to = from_search(p, best[i]);
    const double slope = (from_search(p, best[i] + 1e-4) - from_search(p, best[i] - 1e-4)) / 2e-4;
    result.parameters.push_back(
        {p, get_parameter(start, p.path), to, std::abs(slope) * spread[i], std::abs(best[i]) > 4.6});
  }
  return result;
}

std::vector<FreeParameter> default_free_parameters(const Model& model) {
  std::vector<FreeParameter> out;
  for (const auto& path : parameter_paths(model)) {
    const bool wanted =
        path.starts_with("material.") || path.starts_with("polycrystal.") || path.starts_with("effects.");
    if (!wanted || path == "material.temperature") continue;
    // A spread that is zero is absent; switching it on is an effect, not a fit.
    if (path.starts_with("polycrystal.") && get_parameter(model, path) == 0) continue;
    out.push_back(free_parameter(model, path));
  }
  return out;
}

}  // namespace ferrobench::model

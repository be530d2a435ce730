#include "model/inference/solver/least_squares.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "model/inference/solver/bounded_quadratic.h"

namespace ferrobench::model {
namespace {

// Damping, in shares of the diagonal of J^T J: of the first step; where nothing is left to be gained by less
// of it, or by more.
constexpr double first_damping = 1e-2, least_damping = 1e-9, most_damping = 1e8;
// A step is taken if it gains this share of what the linear model promises.
constexpr double enough_gained = 1e-3;
// What a parameter without any slope is held by, in shares of the largest diagonal element.
constexpr double least_of_diagonal = 1e-12;

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
  const auto n = static_cast<Eigen::Index>(start.size());
  LeastSquaresResult out{.at = start, .squares = std::numeric_limits<double>::infinity()};
  Eigen::VectorXd residual(static_cast<Eigen::Index>(residuals)), moved = residual;
  Eigen::MatrixXd slopes;
  const auto with_slopes = [&](std::span<const double> at) {
    const std::span<double> rows(residual.data(), residuals);
    if (options.slopes && options.slopes(at, rows, slopes)) return true;
    if (!function(at, rows)) return false;
    slopes = jacobian(residual, at, function, options.difference);
    return true;
  };
  const auto take = [&](std::vector<double> at) {
    out = {std::move(at), residual.squaredNorm()};
    if (options.progress) options.progress(out.squares, out.at);
  };
  if (!with_slopes(start)) return out;
  take(start);
  double damping = first_damping, growth = 2;
  for (int i = 0; i < options.iterations && damping < most_damping; ++i) {
    const Eigen::MatrixXd normal = slopes.transpose() * slopes;
    const Eigen::VectorXd gradient = slopes.transpose() * residual;
    Eigen::MatrixXd damped = normal;
    damped.diagonal() += damping * normal.diagonal();
    damped.diagonal().array() += least_of_diagonal * normal.diagonal().maxCoeff();
    const Eigen::Map<const Eigen::VectorXd> at(out.at.data(), n);
    const Eigen::VectorXd step =
        inference::bounded_minimum(damped, gradient, -at, Eigen::VectorXd::Ones(n) - at);
    const double promised = -step.dot(2 * gradient + normal * step);
    if (!(promised > options.tolerance * out.squares)) break;
    std::vector<double> there(start.size());
    Eigen::Map<Eigen::VectorXd>(there.data(), n) = (at + step).cwiseMax(0).cwiseMin(1);
    const double gained = function(there, {moved.data(), residuals})
                              ? out.squares - moved.squaredNorm()
                              : -std::numeric_limits<double>::infinity();
    if (!(gained > enough_gained * promised)) {
      damping *= growth;
      growth *= 2;
      continue;
    }
    if (!with_slopes(there)) break;
    const double before = out.squares;
    take(std::move(there));
    if (gained < options.tolerance * before) break;
    damping *= std::max(1.0 / 3, 1 - std::pow(2 * gained / promised - 1, 3));
    damping = std::max(damping, least_damping);
    growth = 2;
  }
  return out;
}

}  // namespace ferrobench::model

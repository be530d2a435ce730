// Bounded nonlinear least squares, in coordinates that run from 0 to 1 between a parameter's bounds:
// Levenberg-Marquardt (Nocedal and Wright, Numerical Optimization, ch. 10), each step s the minimum of
//
//   |r + J s|^2 + damping s^T diag(J^T J) s   between the bounds (solver/bounded_quadratic.h)
//
// with the damping by how much of the promised gain was had (H. B. Nielsen, Damping parameter in Marquardt's
// method, IMM-REP-1999-05).
#pragma once

#include <Eigen/Dense>
#include <functional>
#include <span>
#include <vector>

namespace ferrobench::model {

// False where the residuals cannot be had: a step there is shortened. May throw, which ends the solution.
// For differences it is called from several threads at once.
using ResidualFunction = std::function<bool(std::span<const double> unit, std::span<double> out)>;
// The same with d residual / d coordinate.
using SlopeFunction =
    std::function<bool(std::span<const double> unit, std::span<double> out, Eigen::MatrixXd& slopes)>;

struct LeastSquaresOptions {
  int iterations = 30;
  double tolerance = 1e-5;  // ends once a step gains a smaller share of the sum of squares
  // Half the distance of the two points of a central difference. Sums over domains are steps on the scale of
  // a domain's own field, which a difference has to be wide against.
  double difference = 3e-3;
  // Exact slopes; without them, or where they cannot be had, differences are taken.
  SlopeFunction slopes{};
  // Called with the sum of squares and the place at the start and after each step that gained.
  std::function<void(double squares, std::span<const double> at)> progress{};
};

struct LeastSquaresResult {
  std::vector<double> at;
  double squares = 0;  // infinite if the residuals cannot be had at the start
};

LeastSquaresResult least_squares(std::size_t residuals, const std::vector<double>& start,
                                 const ResidualFunction& function, const LeastSquaresOptions& options);

// d residual / d coordinate by central differences around `at`, where the residuals are `middle`; from one
// side at a bound or where the other side cannot be had, and zero where neither can. The columns are made
// side by side.
Eigen::MatrixXd jacobian(const Eigen::VectorXd& middle, std::span<const double> at,
                         const ResidualFunction& function, double difference);

}  // namespace ferrobench::model

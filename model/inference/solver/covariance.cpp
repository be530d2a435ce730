#include "model/inference/solver/covariance.h"

#include <algorithm>

namespace ferrobench::model {
double correlated_rows(const Eigen::Ref<const Eigen::VectorXd>& r) {
  const auto n = r.size();
  const double variance = r.squaredNorm();
  double sum = 1;
  for (Eigen::Index lag = 1; lag < n / 2 && variance > 0; ++lag) {
    const double rho = r.head(n - lag).dot(r.tail(n - lag)) / variance;
    if (rho <= 0) break;
    sum += 2 * rho;
  }
  return sum;
}

Eigen::MatrixXd covariance(const std::vector<ResidualPart>& parts, const Eigen::VectorXd& residuals,
                           const Eigen::MatrixXd& slopes) {
  constexpr double uniform = 12;  // 1 / variance of a uniform distribution over [0, 1]
  const auto n = slopes.cols();
  const Eigen::MatrixXd prior = uniform * Eigen::MatrixXd::Identity(n, n);
  Eigen::MatrixXd information = prior, spread = prior;
  for (const auto& part : parts) {
    const auto first = static_cast<Eigen::Index>(part.first), count = static_cast<Eigen::Index>(part.count);
    if (count == 0) continue;
    const auto j = slopes.middleRows(first, count);
    const auto r = residuals.segment(first, count);
    const double left = r.squaredNorm() / static_cast<double>(count);
    const double variance = std::max(left, part.in_standard_deviations ? 1 : 1e-300);
    const Eigen::MatrixXd square = j.transpose() * j / variance;
    information += square;
    spread += (part.in_standard_deviations ? 1 : correlated_rows(r)) * square;
  }
  const Eigen::MatrixXd inverse = information.ldlt().solve(Eigen::MatrixXd::Identity(n, n));
  return inverse * spread * inverse;
}

Eigen::MatrixXd disagreement_of_groups(const std::vector<Eigen::Index>& groups,
                                       const Eigen::VectorXd& residuals, const Eigen::MatrixXd& slopes,
                                       const Eigen::MatrixXd& information) {
  // What a group alone determines has a leverage of 1 and, at the minimum, no score. A fit ends a little
  // beside the minimum, and that little is not to be divided by nothing.
  constexpr double least_free = 0.05;
  const auto n = slopes.cols();
  const Eigen::LLT<Eigen::MatrixXd> cholesky(information);
  Eigen::MatrixXd out = Eigen::MatrixXd::Zero(n, n);
  // Directions that nothing determines leave no information to compare by, and are as wide as can be anyway.
  if (cholesky.info() != Eigen::Success) return out;
  for (std::size_t g = 0; g < groups.size(); ++g) {
    const auto begin = groups[g], end = g + 1 < groups.size() ? groups[g + 1] : slopes.rows();
    const Eigen::MatrixXd j = slopes.middleRows(begin, end - begin);
    // In coordinates in which the information is the identity.
    const Eigen::MatrixXd scaled = cholesky.matrixL().solve(j.transpose());
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> leverage(scaled * scaled.transpose());
    const Eigen::VectorXd free = (1 - leverage.eigenvalues().array()).max(least_free);
    const auto& axes = leverage.eigenvectors();
    const Eigen::VectorXd score =
        axes *
        (axes.transpose() * (scaled * residuals.segment(begin, end - begin))).cwiseQuotient(free.cwiseSqrt());
    const Eigen::VectorXd step = cholesky.matrixU().solve(score);
    out += step * step.transpose();
  }
  return out;
}

}  // namespace ferrobench::model

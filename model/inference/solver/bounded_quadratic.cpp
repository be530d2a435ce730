#include "model/inference/solver/bounded_quadratic.h"

#include <cmath>
#include <vector>

namespace ferrobench::model::inference {
namespace {

// Sets are left and entered at most so often, times the number of variables: far more than is ever needed,
// and an end where rounding would let the same two sets take turns.
constexpr int most_changes = 10;
// A multiplier of the wrong sign below this is rounding, beside what the gradient was at first.
constexpr double rounding = 1e-12;

enum class At { between, low, high };

}  // namespace

Eigen::VectorXd bounded_minimum(const Eigen::MatrixXd& a, const Eigen::VectorXd& g,
                                const Eigen::VectorXd& low, const Eigen::VectorXd& high) {
  const Eigen::Index n = g.size();
  const Eigen::VectorXd unit = a.diagonal().cwiseSqrt().cwiseInverse();  // so that slopes compare
  const double least = rounding * g.cwiseProduct(unit).cwiseAbs().sum();
  Eigen::VectorXd d = Eigen::VectorXd::Zero(n);
  std::vector<At> place(static_cast<std::size_t>(n), At::between);
  const auto at = [&](Eigen::Index i) -> At& { return place[static_cast<std::size_t>(i)]; };
  for (Eigen::Index change = 0; change < most_changes * n; ++change) {
    std::vector<Eigen::Index> free;
    for (Eigen::Index i = 0; i < n; ++i)
      if (at(i) == At::between) free.push_back(i);
    // Towards the minimum of those that are free, as far as the first bound.
    const Eigen::VectorXd slope = g + a * d;
    const Eigen::VectorXd step = -a(free, free).ldlt().solve(slope(free));
    double share = 1;
    Eigen::Index first = -1;
    for (std::size_t k = 0; k < free.size(); ++k) {
      const double s = step[static_cast<Eigen::Index>(k)];
      const auto i = free[k];
      const double room = s < 0 ? d[i] - low[i] : high[i] - d[i];
      if (std::abs(s) * share <= room) continue;
      share = room / std::abs(s);
      first = i;
    }
    for (std::size_t k = 0; k < free.size(); ++k) {
      const double s = step[static_cast<Eigen::Index>(k)];
      d[free[k]] += share * s;
      if (free[k] != first) continue;
      at(first) = s < 0 ? At::low : At::high;
      d[first] = s < 0 ? low[first] : high[first];
    }
    if (first >= 0) continue;
    // There, the one whose bound keeps it most from falling further is let go.
    const Eigen::VectorXd multiplier = g + a * d;
    double most = least;
    Eigen::Index released = -1;
    for (Eigen::Index i = 0; i < n; ++i) {
      const double inwards = (at(i) == At::low ? -1 : at(i) == At::high ? 1 : 0) * multiplier[i] * unit[i];
      if (inwards <= most) continue;
      most = inwards;
      released = i;
    }
    if (released < 0) break;
    at(released) = At::between;
  }
  return d;
}

}  // namespace ferrobench::model::inference

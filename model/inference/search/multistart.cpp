#include "model/inference/search/multistart.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include "model/inference/common/parallel.h"

namespace ferrobench::model::inference {
namespace {

// Fits with exact slopes come to the same minimum from nearly everywhere: on a bench of the campaign all of
// four came to within 0.5 % of it, from up to 480 times its sum of squares.
constexpr int other_starts = 2;

}  // namespace

Multistart fit_base(const WhitenedResiduals& coarse, WhitenedResiduals& fine, const Hypothesis& base,
                    const MultistartOptions& options) {
  std::mt19937_64 random(options.seed);
  std::normal_distribution<double> normal;
  SolverOptions solver{.iterations = 20, .enough = 5, .tick = {}};
  solver.tick = [&] { options.tick("recalibrating the model", 0.03); };
  Fit best = minimize(coarse, base, options.start.size() > 0 ? options.start : prior_mean(base), solver);
  if (options.is_enough && options.is_enough(best)) return {std::move(best), 1, 0, true};
  const double first = best.squares;
  double least = std::numeric_limits<double>::infinity();
  solver.iterations = 8;
  std::vector<Eigen::VectorXd> starts(other_starts, prior_mean(base));
  for (auto& z : starts)
    for (double& v : z) v = normal(random);
  std::atomic<int> ended = 0;
  solver.tick = [&] { options.tick("recalibrating from other starts", 0.1 + 0.15 * ended / other_starts); };
  std::vector<Fit> others(other_starts);
  in_parallel(other_starts, coarse.threads(), [&](std::size_t i) {
    others[i] = minimize(coarse, base, starts[i], solver);
    ++ended;
  });
  for (auto& other : others) {
    least = std::min(least, other.squares);
    if (other.squares < 0.98 * best.squares) best = std::move(other);
  }
  if (options.roughly_fitted) {
    options.roughly_fitted(best);
    best = minimize(coarse, base, best.z, solver);
  }
  const auto tick = [&] { options.tick("recalibrating the model", 0.27); };
  anchor_corrected(coarse, fine, best, tick);
  refine(coarse, fine, best, LastSteps::cheap, tick);
  const bool is_final = best.squares <= options.rejected;
  if (is_final) refine_around_anchor(coarse, fine, best, tick);
  if (!std::isfinite(best.squares))
    throw Error(ErrorCode::numerical, "what was measured cannot be compared with the model",
                Problem{.message = "their difference is not a finite number"});
  return {.fit = std::move(best),
          .starts = 1 + other_starts,
          .spread = (least - first) / first,
          .is_final = is_final};
}

}  // namespace ferrobench::model::inference

// The base model recalibrated from a start and from others, drawn from the prior, since the posterior may
// have several minima.
#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <string>

#include "model/inference/solver/multifidelity.h"

namespace ferrobench::model::inference {

struct MultistartOptions {
  std::uint64_t seed = 1;   // of the other starts
  Eigen::VectorXd start{};  // the first one, scaled; empty: the given values
  // Called once the base model stands roughly; changes the residuals (it marginalizes uncertain drives).
  std::function<void(const Fit&)> roughly_fitted{};
  // Asked of the fit from the first start: true ends it there, with no other starts. Null: never.
  std::function<bool(const Fit&)> is_enough{};
  // A fit that leaves more than this sum of squares is not taken to the end of the fine simulation, which is
  // most of what a recalibration costs.
  double rejected = std::numeric_limits<double>::infinity();
  std::function<void(const std::string& stage, double fraction)> tick;
};

struct Multistart {
  Fit fit;
  int starts = 0;         // of the solver
  double spread = 0;      // sum of squares of the best other start over that of the first, less 1
  bool ended = false;     // by is_enough
  bool is_final = false;  // at the minimum of the fine simulation
};

// Throws Error(numerical) if the residuals at the best minimum are not finite.
Multistart fit_base(const WhitenedResiduals& coarse, WhitenedResiduals& fine, const Hypothesis& base,
                    const MultistartOptions& options);

}  // namespace ferrobench::model::inference

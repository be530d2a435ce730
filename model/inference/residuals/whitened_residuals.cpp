#include "model/inference/residuals/whitened_residuals.h"

#include <algorithm>

#include "model/inference/common/parallel.h"

namespace ferrobench::model::inference {
namespace {

using Place = std::pair<const Hypothesis*, Eigen::VectorXd>;

// One is the other with channels scaled.
bool scaled(const Place& a, const Place& b) {
  if (a.first != b.first) return false;
  for (Eigen::Index i = 0; i < a.second.size(); ++i)
    if (a.second[i] != b.second[i] && !a.first->parameters[static_cast<std::size_t>(i)].scales_only)
      return false;
  return true;
}

}  // namespace

std::vector<Eigen::VectorXd> WhitenedResiduals::evaluate(
    const std::vector<std::pair<const Hypothesis*, Eigen::VectorXd>>& places) const {
  std::vector<Eigen::VectorXd> out(places.size(), Eigen::VectorXd(size_));
  std::vector<std::vector<Wanted>> groups;
  for (std::size_t p = 0; p < places.size(); ++p) {
    auto setting = possible_setting(*places[p].first, places[p].second);
    if (!setting) {
      out[p].setConstant(unsolvable);
      continue;
    }
    Wanted wanted{p, *std::move(setting), &out[p]};
    const auto alike = std::ranges::find_if(
        groups, [&](const auto& group) { return scaled(places[group.front().place], places[p]); });
    if (alike == groups.end())
      groups.push_back({std::move(wanted)});
    else
      alike->push_back(std::move(wanted));
  }
  const auto ordered = parts();
  in_parallel(groups.size() * ordered.size(), threads_,
              [&](std::size_t i) { fill(groups[i % groups.size()], ordered[i / groups.size()]); });
  simulations_ += static_cast<int>(groups.size());
  return out;
}

Eigen::VectorXd WhitenedResiduals::evaluate(const Hypothesis& hypothesis, const Eigen::VectorXd& z) const {
  return evaluate({{&hypothesis, z}}).front();
}

}  // namespace ferrobench::model::inference

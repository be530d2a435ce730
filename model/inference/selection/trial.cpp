#include "model/inference/selection/trial.h"

#include <algorithm>
#include <cmath>

namespace ferrobench::model::inference {

double bic_penalty(const std::vector<const Effect*>& effects, double samples) {
  double numbers = 0;
  for (const auto* e : effects) numbers += static_cast<double>(e->parameters.size());
  return numbers * std::log(samples);
}

double delta_bic(const Trial& t, double samples) {
  return t.drop - bic_penalty(t.effects, samples);
}

double allowed_remainder(const SelectionOptions& options, double drop) {
  return std::max(options.second_detection, options.relative_remainder * drop);
}

double nearness(const SelectionOptions& options, double drop) {
  return std::max(3 * options.second_detection, options.comparable_share * drop);
}

bool has_lack_of_fit(const ForwardSelection& found, const SelectionOptions& options) {
  return found.excess > options.lack_of_fit || found.left > options.detection;
}

}  // namespace ferrobench::model::inference

#include "model/inference/search/starts.h"

#include <algorithm>
#include <cmath>

namespace ferrobench::model::inference {
namespace {

// The limits at which the effect would begin to show in the data; none for an effect that is no limit.
Starts limits_in(const WhitenedResiduals& residuals, const Effect& effect, std::vector<double> values) {
  Starts out;
  for (const double limit : residuals.limits(effect.parameters.front())) {
    values.front() = limit;
    out.push_back(values);
  }
  return out;
}

}  // namespace

Starts starts_around(const WhitenedResiduals& residuals, const Effect& effect,
                     const std::vector<double>& values) {
  const Amplitude amplitude(effect.parameters.front());
  Starts out = limits_in(residuals, effect, values);
  for (const double factor : {1.0, 0.3, 3.0, 0.1}) {
    out.push_back(values);
    out.back().front() = amplitude.value(factor * amplitude.strength(values.front()));
  }
  for (std::size_t k = 1; k < values.size(); ++k)
    for (const double factor : {0.2, 5.0}) {
      if (effect.parameters[k].name == "frequency") continue;
      out.push_back(values);
      out.back()[k] *= factor;
    }
  return out;
}

Starts plausible_starts(const WhitenedResiduals& residuals, const Effect& effect) {
  const Amplitude amplitude(effect.parameters.front());
  std::vector<double> values;
  for (const auto& p : effect.parameters) values.push_back(std::sqrt(p.low * p.high));
  Starts out = limits_in(residuals, effect, values);
  if (!out.empty()) return out;
  for (const double share : {0.2, 0.5, 0.8}) {
    values.front() = amplitude.value(amplitude.weak * std::pow(amplitude.strong / amplitude.weak, share));
    out.push_back(values);
    if (!amplitude.any_sign) continue;
    out.push_back(values);
    out.back().front() *= -1;
  }
  return out;
}

void make_plausible(const Effect& effect, std::vector<double>& values) {
  for (std::size_t k = 0; k < values.size(); ++k) {
    const auto& p = effect.parameters[k];
    values[k] = std::copysign(std::clamp(std::abs(values[k]), p.low, p.high), values[k]);
  }
}

}  // namespace ferrobench::model::inference

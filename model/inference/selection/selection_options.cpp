#include "model/inference/selection/selection_options.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace ferrobench::model::inference {

namespace {

using Range = Threshold::Range;

// Empty where the value is within the range.
std::string_view wrong_with(double value, Range range) {
  switch (range) {
    case Range::positive:
      return value > 0 ? "" : " must be above 0";
    case Range::not_negative:
      return value >= 0 ? "" : " must not be negative";
    case Range::share:
      return value >= 0 && value <= 1 ? "" : " is a share, 0 to 1";
    case Range::below_one:
      return value >= 0 && value < 1 ? "" : " is a share below 1";
    case Range::at_least_one:
    case Range::above_one:
      return value >= 1 ? "" : " must be at least 1";
  }
  return "";
}

}  // namespace

std::span<const Threshold> thresholds() {
  using O = SelectionOptions;
  static constexpr auto all = std::to_array<Threshold>({
      {"detection", &O::detection},
      {"second_detection", &O::second_detection},
      {"relative_remainder", &O::relative_remainder},
      {"lack_of_fit", &O::lack_of_fit},
      {"misled_base", &O::misled_base, Range::above_one},
      {"better_base", &O::better_base},
      {"unfinished_base", &O::unfinished_base, Range::at_least_one},
      {"noise_uncertainty", &O::noise_uncertainty, Range::share},
      {"refit_share_of_detection", &O::refit_share_of_detection, Range::share},
      {"refit_share_of_best", &O::refit_share_of_best, Range::share},
      {"testable", &O::testable},
      {"single_refits", &O::single_refits, Range::at_least_one},
      {"compared", &O::compared, Range::at_least_one},
      {"first_effects", &O::first_effects, Range::at_least_one},
      {"second_effects", &O::second_effects, Range::at_least_one},
      {"checked_pairs", &O::checked_pairs, Range::at_least_one},
      {"plausible_refits", &O::plausible_refits, Range::at_least_one},
      {"starts_per_effect", &O::starts_per_effect, Range::at_least_one},
      {"starts_in_all", &O::starts_in_all, Range::at_least_one},
      {"stepped_starts", &O::stepped_starts, Range::at_least_one},
      {"abandoned", &O::abandoned, Range::above_one},
      {"trusted_decrease", &O::trusted_decrease, Range::at_least_one},
      {"wild_step", &O::wild_step},
      {"base_restarts", &O::base_restarts, Range::not_negative},
      {"unfinished_remainder", &O::unfinished_remainder, Range::at_least_one},
      {"unfinished_decrease", &O::unfinished_decrease, Range::at_least_one},
      {"reachable_remainder", &O::reachable_remainder},
      {"hopeless_remainder", &O::hopeless_remainder},
      {"material_share", &O::material_share, Range::below_one},
      {"comparable_share", &O::comparable_share, Range::share},
      {"likelihood_tempering", &O::likelihood_tempering, Range::at_least_one},
      {"confident", &O::confident, Range::below_one},
      {"detection_width", &O::detection_width},
      {"sufficiency_power", &O::sufficiency_power},
      {"least_probability", &O::least_probability, Range::share},
      {"plausible_margin", &O::plausible_margin, Range::above_one},
      {"equivalent", &O::equivalent},
      {"decisive_odds", &O::decisive_odds, Range::at_least_one},
      {"longest_experiment", &O::longest_experiment},
      {"experiment_rows", &O::experiment_rows, Range::at_least_one},
  });
  static_assert(sizeof(O) == (all.size() + 1) * sizeof(double), "one is missing; single_effect is none");
  return all;
}

double value_of(const SelectionOptions& options, const Threshold& threshold) {
  return std::visit([&](auto member) { return static_cast<double>(options.*member); }, threshold.member);
}

SelectionOptions scaled(SelectionOptions options, const Threshold& threshold, double factor) {
  const double value = value_of(options, threshold);
  const bool from_one = threshold.range == Range::below_one || threshold.range == Range::above_one;
  const double changed = from_one ? 1 + factor * (value - 1) : factor * value;
  if (const auto* count = std::get_if<std::size_t SelectionOptions::*>(&threshold.member))
    options.*(*count) = static_cast<std::size_t>(std::max(1.0, std::round(changed)));
  else
    options.*std::get<double SelectionOptions::*>(threshold.member) = changed;
  return options;
}

void SelectionOptions::raise_detection(double drop) {
  const double ratio = std::max(1.0, drop / detection);
  detection *= ratio;
  second_detection *= ratio;
}

bool SelectionOptions::is_valid(std::string* error) const {
  const auto wrong = [error](const std::string& what) {
    if (error != nullptr) *error = what;
    return false;
  };
  for (const auto& threshold : thresholds()) {
    const double value = value_of(*this, threshold);
    const auto problem = std::isfinite(value) ? wrong_with(value, threshold.range) : " must be finite";
    if (!problem.empty()) return wrong(std::string(threshold.name) + std::string(problem));
  }
  if (!(confident > 0.5)) return wrong("confident is a probability, 0.5 to 1");
  if (!(unfinished_remainder <= reachable_remainder && reachable_remainder <= hopeless_remainder))
    return wrong("unfinished_remainder, reachable_remainder and hopeless_remainder must rise");
  return true;
}

}  // namespace ferrobench::model::inference

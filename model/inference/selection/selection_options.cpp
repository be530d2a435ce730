#include "model/inference/selection/selection_options.h"

#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <utility>

namespace ferrobench::model::inference {

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
  for (const auto& [name, value] :
       std::initializer_list<std::pair<const char*, double>>{{"detection", detection},
                                                             {"second_detection", second_detection},
                                                             {"relative_remainder", relative_remainder},
                                                             {"lack_of_fit", lack_of_fit},
                                                             {"better_base", better_base},
                                                             {"testable", testable},
                                                             {"wild_step", wild_step},
                                                             {"detection_width", detection_width},
                                                             {"sufficiency_power", sufficiency_power},
                                                             {"longest_experiment", longest_experiment}})
    if (!(value > 0) || !std::isfinite(value)) return wrong(std::string(name) + " must be above 0");
  for (const auto& [name, value] : std::initializer_list<std::pair<const char*, double>>{
           {"refit_share_of_detection", refit_share_of_detection},
           {"refit_share_of_best", refit_share_of_best},
           {"comparable_share", comparable_share},
           {"noise_uncertainty", noise_uncertainty},
           {"material_share", material_share},
           {"least_probability", least_probability}})
    if (!(value >= 0 && value <= 1)) return wrong(std::string(name) + " is a share, 0 to 1");
  for (const auto& [name, value] :
       std::initializer_list<std::pair<const char*, double>>{{"misled_base", misled_base},
                                                             {"abandoned", abandoned},
                                                             {"unfinished_base", unfinished_base},
                                                             {"trusted_decrease", trusted_decrease},
                                                             {"unfinished_remainder", unfinished_remainder},
                                                             {"unfinished_decrease", unfinished_decrease},
                                                             {"likelihood_tempering", likelihood_tempering},
                                                             {"plausible_margin", plausible_margin},
                                                             {"decisive_odds", decisive_odds}})
    if (!(value >= 1)) return wrong(std::string(name) + " must be at least 1");
  for (const auto& [name, value] :
       std::initializer_list<std::pair<const char*, std::size_t>>{{"single_refits", single_refits},
                                                                  {"compared", compared},
                                                                  {"first_effects", first_effects},
                                                                  {"second_effects", second_effects},
                                                                  {"checked_pairs", checked_pairs},
                                                                  {"plausible_refits", plausible_refits},
                                                                  {"starts_per_effect", starts_per_effect},
                                                                  {"starts_in_all", starts_in_all},
                                                                  {"stepped_starts", stepped_starts},
                                                                  {"experiment_rows", experiment_rows}})
    if (value == 0) return wrong(std::string(name) + " must be at least 1");
  if (material_share == 1) return wrong("material_share must be below 1: an effect cannot take all there is");
  if (!(confident > 0.5 && confident < 1)) return wrong("confident is a probability, 0.5 to 1");
  if (!(unfinished_remainder <= reachable_remainder && reachable_remainder <= hopeless_remainder))
    return wrong("unfinished_remainder, reachable_remainder and hopeless_remainder must rise");
  return true;
}

}  // namespace ferrobench::model::inference

// Stepwise forward selection of effects. Those that the score test suggests are refitted together with
// everything else and compared by BIC; then second effects beside the best. An explanation is sufficient if
// nothing that the catalogue or plain functions of the signals could explain is left afterwards.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "model/inference/selection/trial.h"

namespace ferrobench::model::inference {

struct SelectionTask {
  std::vector<const Effect*> candidates;
  // Explanations by one effect that were found from another fit of the base model.
  std::vector<Trial> known{};
  int most_domains = 0;       // of the fine simulation
  bool doubt_base = false;    // whether the base fit may have ended elsewhere than at its minimum
  bool base_is_final = true;  // else it is judged by SelectionOptions::unfinished_base
  // The drop that something that is no effect would still bring; null: not asked.
  std::function<double(const Fit&)> beyond_effects;
  std::function<void(const std::string& stage, double fraction)> tick;  // may be null; may throw
};

// `fine` is like `coarse`, with a simulation whose error does not show: fits that are judged are corrected by
// it, and its fidelity is raised where they want that.
ForwardSelection select_forward(const WhitenedResiduals& coarse, WhitenedResiduals& fine, const Fit& base,
                                const SelectionTask& task, const SelectionOptions& options);

}  // namespace ferrobench::model::inference

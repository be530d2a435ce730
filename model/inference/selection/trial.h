// An explanation that was tried: the base model with one or two effects, everything refitted.
#pragma once

#include <optional>
#include <vector>

#include "model/inference/selection/screening.h"
#include "model/inference/selection/selection_options.h"

namespace ferrobench::model::inference {

struct Trial {
  std::vector<const Effect*> effects;
  Fit fit;
  double drop = 0;             // of the sum of squares, against the base model's fit
  bool begun = false;          // only a few steps were made
  bool polished = false;       // fitted to the end
  double numerical_error = 0;  // of the fine simulation there, root mean square in standard deviations
  // What is left, once it was checked: the largest drop that one more effect, or functions of the signals,
  // would bring.
  bool checked = false;
  double left = 0;
};

// What forward selection found.
struct ForwardSelection {
  std::vector<Screened> screened;  // around the base fit
  std::vector<Trial> trials;       // best first, by the difference of BIC
  bool detected = false;
  double excess = 0;  // of the base fit's mean squares over 1
  double left = 0;    // if nothing was detected: the drop that functions of the signals would still bring
  // A better fit of the base model that came up. Nothing else is told then: all has to be asked again from
  // it.
  std::optional<Fit> better_base;
  // Likewise: whether what the base fit may still gain decides, so that it has to be taken to its end first.
  bool base_decides = false;
};

// k ln n for the k parameters of the effects and n residuals: what BIC wants an explanation to earn.
double bic_penalty(const std::vector<const Effect*>& effects, double samples);
// BIC of the base model less that of the trial: its drop less the penalty.
double delta_bic(const Trial& trial, double samples);
// What may be left after an explanation that brought this drop: nothing detectable, or what is small against
// it.
double allowed_remainder(const SelectionOptions& options, double drop);
// Explanations within this of the best one's sum of squares, which has brought this drop, are compared with
// it.
double nearness(const SelectionOptions& options, double drop);
// Whether the base fit leaves something that is no noise, whatever it is (lack of fit).
bool has_lack_of_fit(const ForwardSelection& found, const SelectionOptions& options);

}  // namespace ferrobench::model::inference

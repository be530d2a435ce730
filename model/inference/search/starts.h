// Where an effect's parameters may start a refit.
#pragma once

#include <vector>

#include "model/effects/catalogue.h"
#include "model/inference/residuals/whitened_residuals.h"

namespace ferrobench::model::inference {

using Starts = std::vector<std::vector<double>>;  // values of an effect's parameters

// Weaker and stronger than `values`, and of other shapes; for an effect that is a limit also at what the data
// reached.
Starts starts_around(const WhitenedResiduals& residuals, const Effect& effect,
                     const std::vector<double>& values);
// Over the plausible range of the effect's size, of either sign where that has a meaning; a limit at what the
// data reached.
Starts plausible_starts(const WhitenedResiduals& residuals, const Effect& effect);
// Moves each value to the nearest plausible one.
void make_plausible(const Effect& effect, std::vector<double>& values);

}  // namespace ferrobench::model::inference

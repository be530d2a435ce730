// The experiment that would tell two explanations A and B apart (model discrimination: Box and Hill,
// Technometrics 9 (1967) 57).
//
// For each protocol of the library, what A gives is taken as measured, with the bench's noise, and B may
// adjust its numbers to it as far as the recordings that are there allow:
//
//   T = min over d of |W (y_A - y_B) - J_B d|^2 + d^T N_B d,      odds = exp(T / 2s)
//
// with N_B the information that B's numbers rest on already, and s the tempering of the likelihood.
#pragma once

#include <optional>
#include <vector>

#include "model/inference/residuals/whitened_recordings.h"
#include "model/inference/selection/explanation.h"
#include "model/inference/selection/selection_options.h"
#include "model/inference/solver/gauss_newton.h"

namespace ferrobench::model::inference {

// The best one, or none if no protocol of the library is expected to decide. Protocols that go to fields
// beyond those of the recordings are left out.
std::optional<NextExperiment> choose_experiment(const WhitenedRecordings& residuals,
                                                const std::vector<std::vector<NoiseModel>>& noise,
                                                const Fit& a, const Fit& b, const SelectionOptions& options);

}  // namespace ferrobench::model::inference

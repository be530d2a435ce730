// The model's own error beside the noise, where it misses by more (observation/noise.h): how large it is in
// each channel of each recording, and what a model misses, weighed by it.
#pragma once

#include <vector>

#include "model/inference/observation/noise.h"
#include "model/inference/study/validation.h"

namespace ferrobench::model::inference {

// Puts the error and the rows that count as one into `noise`, by the misses `standardized` (measured less
// simulated, over noise) of `recordings`. A model that is wrong is not equally wrong everywhere, so each
// channel of each recording has an error of its own, what noise leaves of its mean square. Else the few that
// cannot be explained at all would bend the parameters for all others. Such an error is known by few
// independent rows, and beside errors that are free a fit gives some recordings up for the sake of others: it
// is pooled with the channel's median over the range, by their geometric mean, and none is smaller than half
// of that median.
void estimate_model_errors(const std::vector<BenchRecording>& bench, const Signals& standardized,
                           const std::vector<std::size_t>& recordings,
                           std::vector<std::vector<NoiseModel>>& noise);

// Sum of squares above the noise's (excess_squares), over the variance of noise and model error together.
double excess_beside_error(const std::vector<std::vector<NoiseModel>>& noise, const Signals& standardized,
                           const std::vector<std::size_t>& recordings);

// Twice the logarithm of the likelihood ratio of two models by their misses, each error at its own estimate:
// the sum over channels of recordings of n ln(squares before / squares with), n their independent rows.
double log_likelihood_ratio_beside_error(const std::vector<std::vector<NoiseModel>>& noise,
                                         const Signals& before, const Signals& with,
                                         const std::vector<std::size_t>& recordings);

// The same of two fits, by their residuals and what their priors cost.
double log_likelihood_ratio_beside_error(const WhitenedRecordings& residuals,
                                         const std::vector<std::vector<NoiseModel>>& noise, const Fit& before,
                                         const Fit& with);

// Whether the error is more than the share `floor` of a channel's range in any of `recordings`.
bool is_error_material(const std::vector<BenchRecording>& bench,
                       const std::vector<std::vector<NoiseModel>>& noise,
                       const std::vector<std::size_t>& recordings, double floor);

}  // namespace ferrobench::model::inference

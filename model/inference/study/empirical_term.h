// A data-driven term (model/effects/empirical.h) as a hypothesis: which numbers of it are held, and what is
// known of the others.
#pragma once

#include <vector>

#include "model/inference/observation/noise.h"
#include "model/inference/parameters/scaled_parameters.h"

namespace ferrobench::model::inference {

std::vector<const Effect*> empirical_terms();

// V/m; the term's field_scale, as its tables are level beyond.
double largest_field(const std::vector<BenchRecording>& bench);

// What a weight of 1 adds at the term's port: as much as the model misses of the channel that shows it, in
// the recordings `chosen`, or a twentieth of the largest field. 0 where nothing was measured that would show
// it.
double term_amplitude(const Effect& term, const Model& model, const std::vector<BenchRecording>& bench,
                      const std::vector<std::size_t>& chosen,
                      const std::vector<std::vector<NoiseModel>>& noise);

// With the term. Its first numbers are held at `fixed`; the others, its weights, stand at zero with a normal
// prior of the standard deviation `width`.
Hypothesis with_empirical(const Hypothesis& hypothesis, const Effect& term, const std::vector<double>& fixed,
                          double width);

// Takes gains and offsets out of what may move. They are no part of a model that is handed on, and beside a
// model's own error nobody can tell that an instrument is off: then they are as stated.
void trust_instruments(Hypothesis& hypothesis, Eigen::VectorXd& z);

}  // namespace ferrobench::model::inference

// A data-driven term (model/effects/empirical.h) as a hypothesis: which numbers of it are held, what is known
// of the others, and its fit.
#pragma once

#include <functional>
#include <limits>
#include <vector>

#include "model/inference/observation/noise.h"
#include "model/inference/parameters/scaled_parameters.h"
#include "model/inference/residuals/whitened_recordings.h"
#include "model/inference/solver/gauss_newton.h"

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

struct TriedTerm {
  const Effect* term = nullptr;
  Fit fit;
  double evidence = -std::numeric_limits<double>::infinity();  // 2 ln of the marginal likelihood ratio
};

// The term beside a fit, its first numbers held at `fixed`. The time constant, if it has one, is chosen by a
// grid, the width of the weights by the fixed point of the marginal likelihood (D. J. C. MacKay, Neural
// Comput. 4 (1992) 415). `log_likelihood_ratio` is twice that of a fit over the one without the term.
TriedTerm fit_empirical(const WhitenedRecordings& residuals, const Fit& without, const Effect& term,
                        std::vector<double> fixed,
                        const std::function<double(const Fit&)>& log_likelihood_ratio,
                        const SolverOptions& solver);

// Takes gains and offsets out of what may move. They are no part of a model that is handed on, and beside a
// model's own error nobody can tell that an instrument is off: then they are as stated.
void trust_instruments(Hypothesis& hypothesis, Eigen::VectorXd& z);

}  // namespace ferrobench::model::inference

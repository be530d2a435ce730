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

// The first numbers of a term, which a fit holds: its amplitude, what a weight of 1 adds at its port, is as
// much as the model misses in the recordings `chosen` of the channel that shows it, or a twentieth of the
// largest field; its scale, beyond which its tables are level, is the largest field or the largest extension
// of a spring. An amplitude of 0: nothing was measured that would show it.
std::vector<double> held_numbers(const Effect& term, const Model& model,
                                 const std::vector<BenchRecording>& bench,
                                 const std::vector<std::size_t>& chosen,
                                 const std::vector<std::vector<NoiseModel>>& noise);

// With the term. Its first numbers are held at `fixed`; the others, its weights, stand at zero with a normal
// prior of the standard deviation `width`.
Hypothesis with_empirical(const Hypothesis& hypothesis, const Effect& term, const std::vector<double>& fixed,
                          double width);

// Twice the logarithm of a fit's likelihood ratio over the one without the term.
using LogLikelihoodRatio = std::function<double(const Fit&)>;

// What a term promises beside a fit, were the residual linear in its weights and in all numbers of that fit.
struct LinearizedTerm {
  const Effect* term = nullptr;
  std::vector<double> fixed;  // amplitude, scale and, if there is one, time constant
  double width = 1;           // standard deviation of the weights' prior
  double evidence = -std::numeric_limits<double>::infinity();  // 2 ln of the marginal likelihood ratio
  Eigen::MatrixXd slopes;  // of the weights at zero, by the weights themselves: `width` is not in them
};

// With the first numbers held at `held`. The time constant, if there is one, is chosen by a grid, the width
// by the fixed point of the marginal likelihood (D. J. C. MacKay, Neural Comput. 4 (1992) 415), which costs
// slopes once a time constant.
LinearizedTerm linearize_term(const Effect& term, const WhitenedRecordings& residuals, const Fit& without,
                              std::vector<double> held, const LogLikelihoodRatio& log_likelihood_ratio);

struct TriedTerm {
  const Effect* term = nullptr;
  Fit fit;
  double evidence = -std::numeric_limits<double>::infinity();  // 2 ln of the marginal likelihood ratio
};

// The fit with the term, from weights of zero; the width follows what the fit finds.
TriedTerm fit_empirical(const WhitenedRecordings& residuals, const Fit& without,
                        const LinearizedTerm& at_zero, const LogLikelihoodRatio& log_likelihood_ratio,
                        const SolverOptions& solver);

// Takes gains and offsets out of what may move. They are no part of a model that is handed on, and beside a
// model's own error nobody can tell that an instrument is off: then they are as stated.
void trust_instruments(Hypothesis& hypothesis, Eigen::VectorXd& z);

}  // namespace ferrobench::model::inference

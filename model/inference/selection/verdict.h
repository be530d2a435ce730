// From trials to a verdict with probabilities.
//
// With delta_i the difference of BIC of trial i to the base model, its weight among the sufficient
// explanations is the tempered likelihood ratio exp((delta_i - delta_best) / (2 T)) (Kass and Raftery, J. Am.
// Stat. Assoc. 90 (1995) 773, for T = 1). T, `likelihood_tempering`, is an assumption; how often stated
// probabilities come true is what tests/campaign measures.
#pragma once

#include <optional>
#include <utility>
#include <vector>

#include "model/inference/selection/explanation.h"
#include "model/inference/selection/trial.h"

namespace ferrobench::model::inference {

// Half of the 90 % interval of a normal distribution, in standard deviations.
inline constexpr double interval_90 = 1.645;

// Sums of squares of recordings above those of their noise: before an explanation, and what it leaves.
struct ExcessTaken {
  double before = 0, left = 0;
  double share() const { return before > 0 ? 1 - left / before : 0; }
};

struct ModelSelection {
  Verdict verdict = Verdict::nothing_missing;
  // The best trial that would be sufficient, were it to be believed; null if another is sufficient.
  const Trial* doubted = nullptr;
  std::vector<std::pair<const Trial*, double>> trials;  // with probability, best first
  bool sufficient = false;                              // the first trial leaves nothing but noise
  double probability_unknown = 0, probability_nothing = 0;
  // Of the training recordings, by the first trial; where nothing is sufficient.
  std::optional<ExcessTaken> excess;
};

// What it returns refers to `found`.
ModelSelection select_model(const ForwardSelection& found, const SelectionOptions& options, double samples);

// Whether the held-out recordings refute the best explanation, which brings `drop` on the training
// recordings. They do if the sum of squares of all recordings together falls by less than a detection or,
// where no explanation is sufficient, by less than the material share of the excess. If so, the verdict in
// `selection` becomes "unknown", and the explanation its `doubted` one.
bool refute(ModelSelection& selection, double drop, const ExcessTaken& held_out,
            const SelectionOptions& options);

// Probability that something outside the catalogue is missing, if `share` is the smallest share that an
// effect of the explanation takes of the excess that stood before it.
double probability_of_unknown(double share, const SelectionOptions& options);

// Covariance of a fit's parameters, by which intervals are told. With A the information, P the priors' part
// of it, T the tempering of the likelihood and m the mean square of what is left, at least 1,
//
//   C = A^-1 (T m J^T J + P) A^-1 + disagreement of the channels of recordings (solver/covariance.h)
//
// since physics that a fit has made up for no longer shows in what is left.
Eigen::MatrixXd robust_covariance(const Fit& fit, double tempering);

// 90 % intervals of the parameters of a trial's effects.
std::vector<EffectEstimate> effect_estimates(const Trial& trial, const SelectionOptions& options);

// Whether each effect of a trial is of a plausible size and shape, and is more than nothing: at its shape,
// the interval of its amplitude does not reach to where the effect vanishes. An effect that is not is never
// added, however well it fits.
bool is_believable(const Trial& trial, const SelectionOptions& options);

}  // namespace ferrobench::model::inference

// From trials to a verdict with probabilities. The scale on which evidence counts is an assumption; how often
// stated probabilities come true is what tests/campaign measures.
#pragma once

#include "model/discrepancy/naming.h"

namespace ferrobench::model::discrepancy {

// Sums of squares count for less than their face value: two honest programs differ by more than noise.
inline constexpr double evidence_scale = 12;

struct Judgement {
  Verdict verdict = Verdict::nothing_missing;
  const Trial* doubted =
      nullptr;  // would be enough, were it to be believed: the best of these, if none else is
  std::vector<std::pair<const Trial*, double>> trials;  // with probability, best first
  double probability_unknown = 0, probability_nothing = 0;
};

Judgement judge(const Naming& naming, const NamingOptions& options, double samples);

// By how much standard deviations are wider than noise alone has it: for what noise does not explain, and, as
// with odds, because sums of squares do not count in full.
double widening(const Fit& fit);

// 90 % intervals of the parameters of a trial's effects.
std::vector<EffectEstimate> estimates(const Trial& trial);

// Whether each effect of a trial is of a plausible size and shape, and is more than nothing: its interval
// does not reach to where the effect vanishes. What is not is never added, however well it fits.
bool is_believable(const Trial& trial);

}  // namespace ferrobench::model::discrepancy

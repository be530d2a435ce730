#include "model/discrepancy/verdict.h"

#include <algorithm>
#include <cmath>

namespace ferrobench::model::discrepancy {
namespace {

constexpr double certain = 0.9;  // together, the names that are given

double logistic(double x) {
  return 1 / (1 + std::exp(-x));
}

// From 0 to 1 as a drop passes what can be detected.
double rises_at(double detect, double drop) {
  return logistic((drop - detect) / (0.15 * detect));
}

}  // namespace

Judgement judge(const Naming& naming, const NamingOptions& options, double samples) {
  Judgement out;
  if (!naming.detected && leaves_something(naming, options)) {
    // Nothing that is known would help, but this is not noise.
    out.verdict = Verdict::unknown;
    out.probability_unknown = naming.excess > plain_excess ? certain : rises_at(options.detect, naming.left);
    out.probability_nothing = 1 - out.probability_unknown;
    return out;
  }
  if (naming.trials.empty()) {
    out.probability_nothing = 1;
    return out;
  }
  const double best_any = score(naming.trials.front(), samples);
  out.probability_nothing = 1 - rises_at(options.detect, best_any);
  std::vector<const Trial*> enough;
  double least_left = std::numeric_limits<double>::infinity();
  for (const auto& t : naming.trials) {
    if (!t.checked) continue;
    const double ratio = t.left / allowed_left(options, t.drop);
    least_left = std::min(least_left, ratio);
    if (ratio < 1) enough.push_back(&t);
  }
  const double unknown_if_something = logistic(3 * std::log(std::max(1e-3, least_left)));
  const double something = 1 - out.probability_nothing;
  out.probability_unknown = something * unknown_if_something;
  // Unchecked rivals of the same number of effects count too.
  const Trial* leader = enough.empty() ? &naming.trials.front() : enough.front();
  const double top = score(*leader, samples);
  double sum = 0;
  for (const auto& t : naming.trials) {
    if (t.effects.size() > leader->effects.size()) continue;
    if (t.checked && t.left > allowed_left(options, t.drop) && &t != leader) continue;
    const double w = std::exp(std::min(0.0, (score(t, samples) - top) / (2 * evidence_scale)));
    if (w < 1e-4) continue;
    out.trials.emplace_back(&t, w);
    sum += w;
  }
  for (auto& [t, w] : out.trials) w *= something * (1 - unknown_if_something) / sum;
  std::ranges::stable_sort(out.trials, std::greater<>(), [](const auto& p) { return p.second; });
  if (!naming.detected || out.probability_nothing > 0.5) {
    out.verdict = Verdict::nothing_missing;
  } else if (enough.empty()) {
    out.verdict = Verdict::unknown;
  } else {
    const double named = out.trials.front().second / (something * (1 - unknown_if_something));
    out.verdict = named > certain ? Verdict::named : Verdict::ambiguous;
  }
  return out;
}

double widening(const Fit& fit) {
  const auto rows = static_cast<double>(std::max<Eigen::Index>(1, fit.residual.size()));
  return std::sqrt(evidence_scale * std::max(1.0, fit.residual.squaredNorm() / rows));
}

std::vector<EffectEstimate> estimates(const Trial& trial) {
  const auto& h = trial.fit.hypothesis;
  const Eigen::MatrixXd covariance = trial.fit.normal().inverse();
  const double scale = 1.645 * widening(trial.fit);
  std::vector<EffectEstimate> out;
  std::size_t i = h.base_count;
  for (const auto* effect : trial.effects) {
    EffectEstimate e{.id = std::string(effect->id), .parameters = {}};
    for (const auto& p : effect->parameters) {
      const auto& c = h.coordinates[i];
      const auto k = static_cast<Eigen::Index>(i++);
      const double reach = scale * std::sqrt(std::max(0.0, covariance(k, k)));
      const double z = trial.fit.z[k];
      const double a = c.value(std::max(c.low, z - reach)), b = c.value(std::min(c.high, z + reach));
      e.parameters.push_back({std::string(p.name), c.value(z), std::min(a, b), std::max(a, b)});
    }
    out.push_back(std::move(e));
  }
  return out;
}

}  // namespace ferrobench::model::discrepancy

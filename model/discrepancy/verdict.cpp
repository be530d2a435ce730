#include "model/discrepancy/verdict.h"

#include <algorithm>
#include <cmath>

namespace ferrobench::model::discrepancy {
namespace {

constexpr double certain = 0.9;  // together, the names that are given
constexpr double interval_90 =
    1.645;  // half of the 90 % interval of a normal distribution, over its deviation

double logistic(double x) {
  return 1 / (1 + std::exp(-x));
}

// Plausible ranges have one digit.
constexpr double about = 1.1;

// Calls visit(effect, which of its parameters, coordinate, z, half of the 90 % interval of z).
template <class Visit>
void for_each_parameter(const Trial& trial, Visit&& visit) {
  const auto& h = trial.fit.hypothesis;
  // One that was only begun has no slopes.
  const bool known = trial.fit.jacobian.cols() == trial.fit.z.size();
  const Eigen::MatrixXd covariance = known ? Eigen::MatrixXd(trial.fit.normal().inverse())
                                           : Eigen::MatrixXd::Zero(trial.fit.z.size(), trial.fit.z.size());
  const double scale = interval_90 * widening(trial.fit);
  std::size_t i = h.base_count;
  for (const auto* effect : trial.effects)
    for (std::size_t which = 0; which < effect->parameters.size(); ++which, ++i) {
      const auto k = static_cast<Eigen::Index>(i);
      visit(*effect, which, h.coordinates[i], trial.fit.z[k],
            scale * std::sqrt(std::max(0.0, covariance(k, k))));
    }
}

// By how much the sum of squares rises where each amplitude is held to its plausible range, by the quadratic
// form of the fit at its minimum: ((nearest plausible value - value) / standard deviation)^2.
double cost_of_plausible(const Trial& trial) {
  double cost = 0;
  for_each_parameter(
      trial, [&](const Effect& effect, std::size_t which, const Coordinate& c, double z, double reach) {
        if (which != 0) return;
        const auto& p = effect.parameters[which];
        const double value = std::abs(c.value(z)), nearest = std::clamp(value, p.low / about, p.high * about),
                     deviation = reach * std::abs(c.slope(z)) / (interval_90 * widening(trial.fit));
        if (value != nearest) cost += std::pow((value - nearest) / deviation, 2);
      });
  return cost;
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
    if (!is_believable(t)) {
      if (ratio < 1 && out.doubted == nullptr) out.doubted = &t;
      continue;
    }
    least_left = std::min(least_left, ratio);
    if (ratio < 1) enough.push_back(&t);
  }
  if (!enough.empty()) out.doubted = nullptr;
  const double unknown_if_something = logistic(3 * std::log(std::max(1e-3, least_left)));
  const double something = 1 - out.probability_nothing;
  out.probability_unknown = something * unknown_if_something;
  // Unchecked rivals of the same number of effects count too.
  const Trial* leader = enough.empty() ? &naming.trials.front() : enough.front();
  const double top = score(*leader, samples);
  // No rival counts for more than the leader, which is the one that is added: it stands first among equals.
  out.trials.emplace_back(leader, 1);
  double sum = 1;
  for (const auto& t : naming.trials) {
    if (&t == leader || t.effects.size() > leader->effects.size()) continue;
    if (t.checked && t.left > allowed_left(options, t.drop)) continue;
    // One that is not believable as it was fitted is never added, but it remains a rival with a plausible
    // size.
    const double plausible = score(t, samples) - cost_of_plausible(t);
    const double w = std::exp(std::min(0.0, (plausible - top) / (2 * evidence_scale)));
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
  std::vector<EffectEstimate> out;
  for_each_parameter(
      trial, [&](const Effect& effect, std::size_t which, const Coordinate& c, double z, double reach) {
        if (which == 0) out.push_back({.id = std::string(effect.id), .parameters = {}});
        const double a = c.value(std::max(c.low, z - reach)), b = c.value(std::min(c.high, z + reach));
        out.back().parameters.push_back(
            {std::string(effect.parameters[which].name), c.value(z), std::min(a, b), std::max(a, b)});
      });
  return out;
}

bool is_believable(const Trial& trial) {
  bool out = true;
  for_each_parameter(
      trial, [&](const Effect& effect, std::size_t which, const Coordinate& c, double z, double reach) {
        const auto& p = effect.parameters[which];
        const double value = std::abs(c.value(z));
        if (which == 0) {
          out = out && value > p.low / about && value < p.high * about;
          // A logarithm never comes to nothing: there the interval is as wide as the value, and reaches the
          // weak end.
          const bool to_the_end = (p.off_at_infinity ? z + reach >= c.high : z - reach <= c.low);
          if (reach * std::abs(c.slope(z)) >= value && (!c.logarithmic || to_the_end)) out = false;
        } else {
          const double a = std::abs(c.value(std::max(c.low, z - reach))),
                       b = std::abs(c.value(std::min(c.high, z + reach)));
          out = out && std::min(a, b) < p.high * about && std::max(a, b) > p.low / about;
        }
      });
  return out;
}

}  // namespace ferrobench::model::discrepancy

#include "model/inference/selection/verdict.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "model/inference/solver/covariance.h"

namespace ferrobench::model {

std::span<const std::pair<Verdict, std::string_view>> enum_names(Verdict) {
  static constexpr std::array<std::pair<Verdict, std::string_view>, 4> names{
      {{Verdict::named, "named"},
       {Verdict::ambiguous, "ambiguous"},
       {Verdict::unknown, "unknown"},
       {Verdict::nothing_missing, "nothing_missing"}}};
  return names;
}

}  // namespace ferrobench::model

namespace ferrobench::model::inference {
namespace {

double logistic(double x) {
  return 1 / (1 + std::exp(-x));
}

// Half of the 90 % intervals of a scaled parameter; 0 where a trial was only begun and has no slopes.
struct Reach {
  double all = 0;       // whatever else may move
  double at_shape = 0;  // of an amplitude, the effect's other parameters held
};

bool has_slopes(const Fit& fit) {
  return fit.jacobian.cols() == fit.z.size();
}

// By noise and priors alone; 0 without slopes.
Eigen::MatrixXd posterior_covariance(const Fit& fit) {
  if (!has_slopes(fit)) return Eigen::MatrixXd::Zero(fit.z.size(), fit.z.size());
  return fit.normal().inverse();
}

// Calls visit(effect, which of its parameters, parameter, z, reach) by the covariance of the trial's fit.
template <class Visit>
void for_each_parameter(const Trial& trial, const Eigen::MatrixXd& covariance, Visit&& visit) {
  const auto& fit = trial.fit;
  auto k = static_cast<Eigen::Index>(fit.hypothesis.base_count);
  for (const auto* effect : trial.effects) {
    const auto count = std::ssize(effect->parameters);
    const Eigen::MatrixXd own = covariance.block(k, k, count, count);
    // The variance of one number given others is one over its element of the inverse.
    const double precision = has_slopes(fit) ? own.inverse()(0, 0) : 0;
    const double at_shape = precision > 0 ? interval_90 / std::sqrt(precision) : 0;
    for (std::size_t which = 0; which < effect->parameters.size(); ++which, ++k)
      visit(*effect, which, fit.hypothesis.parameters[static_cast<std::size_t>(k)], fit.z[k],
            Reach{interval_90 * std::sqrt(std::max(0.0, covariance(k, k))), which == 0 ? at_shape : 0});
  }
}

// By how much the sum of squares rises where each amplitude is held to its plausible range, by the quadratic
// form of the fit at its minimum: ((nearest plausible value - value) / standard deviation)^2.
double cost_of_plausible(const Trial& trial, const SelectionOptions& options) {
  const double about = options.plausible_margin;
  double cost = 0;
  for_each_parameter(
      trial, posterior_covariance(trial.fit),
      [&](const Effect& effect, std::size_t which, const ScaledParameter& c, double z, const Reach& reach) {
        if (which != 0) return;
        const auto& p = effect.parameters[which];
        const double least = effect.fades ? p.low / about : 0;  // else it is there at any amplitude
        const double value = std::abs(c.value(z)), nearest = std::clamp(value, least, p.high * about),
                     deviation = reach.all * std::abs(c.slope(z)) / interval_90;
        if (value != nearest) cost += std::pow((value - nearest) / deviation, 2);
      });
  return cost;
}

// From 0 to 1 as a drop passes what can be detected.
double rises_at_detection(const SelectionOptions& options, double drop) {
  return logistic((drop - options.detection) / (options.detection_width * options.detection));
}

// An explanation that leaves more than noise, and the smallest share that any of its effects has.
struct Graded {
  const Trial* trial = nullptr;
  double share = 0;
  ExcessTaken excess{};
};

// The best explanation where none is sufficient: the single effect that leaves least, or a pair if its second
// effect takes a material share of what the best single one leaves. A fit that comes below the noise says
// that the noise was taken for too much, as it is where it is less than simulations resolve: what is left
// counts from that fit then, and is no less than what was seen to remain of it.
Graded best_of_insufficient(const ForwardSelection& found, const SelectionOptions& options, double samples) {
  double noise = samples;
  for (const auto& t : found.trials)
    if (is_believable(t, options)) noise = std::min(noise, t.fit.squares);
  const double unseen = std::sqrt(2 * samples);  // the standard deviation of a sum of squares that is noise
  const double before = std::max((1 + found.excess) * samples - noise, unseen);
  const auto least = [&](std::size_t effects) {
    const Trial* best = nullptr;
    for (const auto& t : found.trials)
      if (t.effects.size() == effects && is_believable(t, options) &&
          (best == nullptr || t.fit.squares < best->fit.squares))
        best = &t;
    return best;
  };
  const auto left = [&](const Trial* t) {
    return std::max({t->fit.squares - noise, t->checked ? t->left : 0, unseen});
  };
  const Trial *single = least(1), *pair = least(2);
  Graded out;
  if (single != nullptr) out = {single, 1 - left(single) / before, {before, left(single)}};
  if (pair == nullptr) return out;
  const double together = 1 - left(pair) / before,
               second = single != nullptr ? 1 - left(pair) / left(single) : together;
  if (second >= options.material_share) out = {pair, std::min(together, second), {before, left(pair)}};
  return out;
}

// How much likelier a trial is than the leader, twice the logarithm: with s the sums of squares,
// n ln(s_leader / s). Residuals that are no noise go together over many rows, and n counts those as one.
double log_odds(const Trial& t, const Trial& leader, const SelectionOptions& options, double samples) {
  const auto& r = leader.fit.residual;
  const double together = r.size() > 0 ? correlated_rows(r) : 1;
  const double n = samples / std::max(options.likelihood_tempering, together);
  return n * std::log(leader.fit.squares / t.fit.squares);
}

// Fills in the verdict where something is there and nothing is sufficient.
void grade(const ForwardSelection& found, const SelectionOptions& options, double samples,
           ModelSelection& out) {
  const auto [leader, share, excess] = best_of_insufficient(found, options, samples);
  const double something = 1 - out.probability_nothing;
  if (leader == nullptr) {
    out.verdict = Verdict::unknown;
    out.probability_unknown = something;
    return;
  }
  const double unknown = probability_of_unknown(share, options);
  out.excess = excess;
  out.probability_unknown = something * unknown;
  out.trials.clear();
  double sum = 0;
  for (const auto& t : found.trials) {
    if (t.effects.size() != leader->effects.size() || (&t != leader && !is_believable(t, options))) continue;
    const double w = std::exp(0.5 * std::min(0.0, log_odds(t, *leader, options, samples)));
    if (w < options.least_probability) continue;
    out.trials.emplace_back(&t, w);
    sum += w;
  }
  for (auto& [t, w] : out.trials) w *= (something - out.probability_unknown) / sum;
  std::ranges::stable_sort(out.trials, std::greater<>(), [](const auto& p) { return p.second; });
  const double first = out.trials.front().second / (something - out.probability_unknown);
  out.verdict = unknown > 0.5               ? Verdict::unknown
                : first > options.confident ? Verdict::named
                                            : Verdict::ambiguous;
  if (out.verdict != Verdict::unknown) out.doubted = nullptr;
}

}  // namespace

ModelSelection select_model(const ForwardSelection& found, const SelectionOptions& options, double samples) {
  ModelSelection out;
  if (!found.detected && has_lack_of_fit(found, options)) {
    // No effect of the catalogue would help, but this is not noise.
    out.verdict = Verdict::unknown;
    out.probability_unknown =
        found.excess > options.lack_of_fit ? options.confident : rises_at_detection(options, found.left);
    out.probability_nothing = 1 - out.probability_unknown;
    return out;
  }
  if (found.trials.empty()) {
    out.probability_nothing = 1;
    return out;
  }
  const double best_any = delta_bic(found.trials.front(), samples);
  out.probability_nothing = 1 - rises_at_detection(options, best_any);
  std::vector<const Trial*> enough;
  double least_left = std::numeric_limits<double>::infinity();
  for (const auto& t : found.trials) {
    if (!t.checked) continue;
    const double ratio = t.left / allowed_remainder(options, t.drop);
    if (!is_believable(t, options)) {
      if (ratio < 1 && out.doubted == nullptr) out.doubted = &t;
      continue;
    }
    least_left = std::min(least_left, ratio);
    if (ratio < 1) enough.push_back(&t);
  }
  out.sufficient = !enough.empty();
  if (out.sufficient) out.doubted = nullptr;
  const double unknown_if_something =
      logistic(options.sufficiency_power * std::log(std::max(1e-3, least_left)));
  const double something = 1 - out.probability_nothing;
  out.probability_unknown = something * unknown_if_something;
  // Unchecked rivals of the same number of effects count too.
  const Trial* leader = !out.sufficient ? &found.trials.front() : enough.front();
  const double top = delta_bic(*leader, samples);
  // No rival counts for more than the leader, which is the one that is added: it stands first among equals.
  out.trials.emplace_back(leader, 1);
  double sum = 1;
  for (const auto& t : found.trials) {
    if (&t == leader || t.effects.size() > leader->effects.size()) continue;
    if (t.checked && t.left > allowed_remainder(options, t.drop)) continue;
    // A trial that is not believable as it was fitted is never added, but it remains a rival at a plausible
    // size.
    const double plausible = delta_bic(t, samples) - cost_of_plausible(t, options);
    const double w = std::exp(std::min(0.0, (plausible - top) / (2 * options.likelihood_tempering)));
    if (w < options.least_probability) continue;
    out.trials.emplace_back(&t, w);
    sum += w;
  }
  for (auto& [t, w] : out.trials) w *= something * (1 - unknown_if_something) / sum;
  std::ranges::stable_sort(out.trials, std::greater<>(), [](const auto& p) { return p.second; });
  if (!found.detected || out.probability_nothing > 0.5) {
    out.verdict = Verdict::nothing_missing;
  } else if (!out.sufficient) {
    grade(found, options, samples, out);
  } else {
    const double named = out.trials.front().second / (something * (1 - unknown_if_something));
    out.verdict = named > options.confident ? Verdict::named : Verdict::ambiguous;
  }
  return out;
}

bool refute(ModelSelection& selection, double drop, const ExcessTaken& held_out,
            const SelectionOptions& options) {
  double unknown = 0;
  if (drop + held_out.before - held_out.left < options.detection) {
    unknown = 1;
  } else if (const auto& training = selection.excess) {
    const double share = 1 - (training->left + held_out.left) / (training->before + held_out.before);
    unknown = probability_of_unknown(share, options);
  }
  if (unknown <= 0.5) return false;
  selection.doubted = selection.trials.front().first;
  selection.trials.clear();
  selection.sufficient = false;
  selection.verdict = Verdict::unknown;
  selection.probability_unknown = (1 - selection.probability_nothing) * unknown;
  return true;
}

double probability_of_unknown(double share, const SelectionOptions& options) {
  const double missed = (1 - share) / (1 - options.material_share);
  return logistic(options.sufficiency_power * std::log(std::max(1e-3, missed)));
}

double tempered_mean_square(const Fit& fit, double tempering) {
  const auto rows = static_cast<double>(std::max<Eigen::Index>(1, fit.residual.size()));
  return tempering * std::max(1.0, fit.residual.squaredNorm() / rows);
}

Eigen::MatrixXd robust_covariance(const Fit& fit, double tempering) {
  if (!has_slopes(fit)) return posterior_covariance(fit);
  const Eigen::MatrixXd information = fit.normal(), inverse = information.inverse();
  const Eigen::MatrixXd of_rows = fit.jacobian.transpose() * fit.jacobian, of_priors = information - of_rows;
  return inverse * (tempered_mean_square(fit, tempering) * of_rows + of_priors) * inverse +
         disagreement_of_groups(fit.groups, fit.residual, fit.jacobian, information);
}

std::vector<EffectEstimate> effect_estimates(const Trial& trial, const SelectionOptions& options) {
  std::vector<EffectEstimate> out;
  for_each_parameter(
      trial, robust_covariance(trial.fit, options.likelihood_tempering),
      [&](const Effect& effect, std::size_t which, const ScaledParameter& c, double z, const Reach& reach) {
        if (which == 0) out.push_back({.id = std::string(effect.id), .parameters = {}});
        const double a = c.value(std::max(c.low, z - reach.all)),
                     b = c.value(std::min(c.high, z + reach.all));
        out.back().parameters.push_back(
            {std::string(effect.parameters[which].name), c.value(z), std::min(a, b), std::max(a, b)});
      });
  return out;
}

bool is_believable(const Trial& trial, const SelectionOptions& options) {
  const double about = options.plausible_margin;
  bool out = true;
  for_each_parameter(
      trial, tempered_mean_square(trial.fit, options.likelihood_tempering) * posterior_covariance(trial.fit),
      [&](const Effect& effect, std::size_t which, const ScaledParameter& c, double z, const Reach& reaches) {
        const auto& p = effect.parameters[which];
        const double value = std::abs(c.value(z));
        if (which == 0) {
          // Whether an effect is there is asked at its shape: of a relaxation much slower than the recordings
          // only amplitude over time constant is determined, and the amplitude's own interval reaches zero
          // however surely something relaxes.
          const double reach = reaches.at_shape;
          out = out && value < p.high * about;
          if (!effect.fades) return;  // it is there at any amplitude
          out = out && value > p.low / about;
          // On a logarithmic scale nothing ever vanishes; there an interval that is as wide as the value and
          // reaches the weak end counts as reaching nothing.
          const bool to_the_end = (p.off_at_infinity ? z + reach >= c.high : z - reach <= c.low);
          if (reach * std::abs(c.slope(z)) >= value && (!c.logarithmic || to_the_end)) out = false;
        } else {
          const double reach = reaches.all;
          const double a = std::abs(c.value(std::max(c.low, z - reach))),
                       b = std::abs(c.value(std::min(c.high, z + reach)));
          out = out && std::min(a, b) < p.high * about && std::max(a, b) > p.low / about;
        }
      });
  return out;
}

}  // namespace ferrobench::model::inference

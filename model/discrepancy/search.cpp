#include "model/discrepancy/search.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <mutex>
#include <random>
#include <thread>

namespace ferrobench::model::discrepancy {
namespace {

constexpr int other_starts = 4;
constexpr int most_again = 2;  // from a better base fit

// From the given model and from other starts: one of them may lead to a better minimum.
Fit fit_base(const Misfit& misfit, Misfit& fine, const Hypothesis& base, const SearchOptions& options,
             Health& health) {
  std::mt19937_64 random(options.seed);
  std::normal_distribution<double> normal;
  FitLimits limits{.iterations = 20, .refreshes = 3, .enough = 5, .roughly = true, .tick = {}};
  limits.tick = [&] { options.tick("recalibrating the model", 0.03); };
  Fit best = fit(misfit, base, at_rest(base), limits);
  const double first = best.squares;
  double least = std::numeric_limits<double>::infinity();
  limits.iterations = 8;
  limits.refreshes = 2;
  std::vector<Eigen::VectorXd> starts(other_starts, at_rest(base));
  for (auto& z : starts)
    for (double& v : z) v = normal(random);
  std::atomic<int> ended = 0;
  limits.tick = [&] { options.tick("recalibrating from other starts", 0.1 + 0.15 * ended / other_starts); };
  std::vector<Fit> others(other_starts);
  in_parallel(other_starts, misfit.threads(), [&](std::size_t i) {
    others[i] = fit(misfit, base, starts[i], limits);
    ++ended;
  });
  for (auto& other : others) {
    least = std::min(least, other.squares);
    if (other.squares < 0.98 * best.squares) best = std::move(other);
  }
  if (options.roughly_fitted) {
    options.roughly_fitted(best);
    limits.roughly = false;
    best = fit(misfit, base, best.z, limits);
  }
  correct(misfit, fine, best);
  settle(misfit, fine, best, [&] { options.tick("recalibrating the model", 0.27); });
  if (!std::isfinite(best.squares))
    throw Error(ErrorCode::numerical, "what was measured cannot be compared with the model",
                Problem{.message = "their difference is not a finite number"});
  health.starts = 1 + other_starts;
  health.start_spread = (least - first) / first;
  return best;
}

std::map<std::string, Recalibration> recalibrations(const Fit& fit) {
  const Eigen::MatrixXd covariance = fit.normal().inverse();
  std::map<std::string, Recalibration> out;
  for (std::size_t i = 0; i < fit.hypothesis.base_count; ++i) {
    const auto& c = fit.hypothesis.coordinates[i];
    const auto k = static_cast<Eigen::Index>(i);
    out[c.path] = {c.from, c.value(fit.z[k]),
                   widening(fit) * std::abs(c.slope(fit.z[k])) * std::sqrt(std::max(0.0, covariance(k, k)))};
  }
  return out;
}

Model model_at(const Fit& fit, const std::string& note) {
  auto out = setting_at(fit.hypothesis, fit.z).model;
  out.notes += (out.notes.empty() ? "" : " ") + note;
  return out;
}

void detectable(Discovery& out, const Search& s) {
  for (const auto& c : s.naming.screened) {
    const bool named = std::ranges::any_of(out.explanations, [&](const Explanation& e) {
      return std::ranges::any_of(e.effects,
                                 [&](const auto& estimate) { return estimate.id == c.effect->id; });
    });
    if (c.excited < 9 && !named) {
      out.not_testable.emplace_back(c.effect->id);
      continue;
    }
    if (c.across <= 0) continue;
    const auto& p = c.effect->parameters.front();
    const Amplitude amplitude(p);
    out.smallest_detectable[std::string(c.effect->id)][std::string(p.name)] =
        amplitude.value(c.strength * std::sqrt((s.options.detect + price({c.effect}, s.samples)) / c.across));
  }
}

// Explanations that these recordings cannot tell apart.
void equivalences(Discovery& out, const Naming& naming, double samples, double close) {
  if (naming.trials.empty()) return;
  const auto& best = naming.trials.front();
  std::vector<std::string> group;
  for (const auto& t : naming.trials)
    if (t.effects.size() == 1 && best.effects.size() == 1 && score(t, samples) > score(best, samples) - close)
      group.emplace_back(t.effects[0]->id);
  if (group.size() > 1) out.equivalent.emplace_back(std::move(group));
}

}  // namespace

int threads_of(const DiscoverOptions& options) {
  return options.threads > 0 ? options.threads
                             : static_cast<int>(std::max(1U, std::thread::hardware_concurrency()));
}

SimulationOptions stoppable(SimulationOptions simulation, const DiscoverOptions& options) {
  if (options.stop) simulation.stop = &options.stop;
  return simulation;
}

Ticker ticker(const DiscoverOptions& options) {
  return [&options, one = std::make_shared<std::mutex>()](const std::string& stage, double fraction) {
    const std::scoped_lock lock(*one);
    if (options.progress && !options.progress({stage, fraction}))
      throw Error(ErrorCode::cancelled, "the search was stopped");
  };
}

void check_held_out(const std::vector<std::string>& wanted, const std::vector<std::string>& names) {
  for (const auto& name : wanted)
    if (std::ranges::find(names, name) == names.end())
      throw Error(
          ErrorCode::invalid_params, "\"" + name + "\" cannot be held out",
          Problem{.path = "/held_out", .message = "is not among them", .given = name, .allowed = names});
  if (std::ranges::all_of(names, [&](const auto& n) { return std::ranges::find(wanted, n) != wanted.end(); }))
    throw Error(ErrorCode::invalid_params, "everything is held out: there is nothing to learn from");
}

std::vector<const Effect*> candidates_of(const Model& model, const std::vector<std::string>& wanted) {
  std::vector<const Effect*> out;
  for (const auto& id : wanted) find_effect(id);
  for (const auto& effect : effect_catalogue()) {
    if (!wanted.empty() && std::ranges::find(wanted, effect.id) == wanted.end()) continue;
    // What the model has already is recalibrated, not found.
    if (std::ranges::any_of(model.effects, [&](const auto& s) { return s.id == effect.id; })) continue;
    if (effect.in_base && effect.in_base(model)) continue;
    try {
      std::vector<double> values;
      for (const auto& p : effect.parameters) values.push_back(std::sqrt(p.low * p.high));
      auto trial = model;
      Ports ports;
      effect.install(values, trial, ports);
    } catch (const Error&) {
      continue;  // has no meaning for such a model
    }
    out.push_back(&effect);
  }
  return out;
}

void choose_simulations(Misfit& usual, Misfit& fine, const Hypothesis& base, int most_domains,
                        Health& health) {
  constexpr double below = 0.8;  // of the noise: what there is of it is corrected for
  const auto z = at_rest(base);
  const auto [exact, error] = refine(fine, base, z, most_domains);
  health.numerical_error_over_noise = error;
  // Of the nodes that are to serve every spread, the base has a third.
  const bool every_spread = fine.simulation().every_spread;
  for (const int count : {250, 500, 1000, 2000, 4000}) {
    usual.simulate_by(
        {.tolerance = 1e-5, .domains = (every_spread ? 4 : 1) * count, .every_spread = every_spread});
    if ((usual.residuals(base, z) - exact).norm() < below * std::sqrt(static_cast<double>(exact.size())))
      break;
  }
}

Search search(const Misfit& misfit, Misfit& fine, const Hypothesis& base, const SearchOptions& options,
              Health& health) {
  Search out;
  out.samples = static_cast<double>(misfit.size());
  out.base = fit_base(misfit, fine, base, options, health);
  out.options = {.candidates = options.candidates,
                 .detect = 60,
                 .second = 60,
                 .small_against = options.small_against,
                 .few = options.few,
                 .most_domains = options.most_domains,
                 .doubt_base = true,
                 .beyond_effects = options.beyond_effects,
                 .tick = {}};
  double begun = 0.3;
  for (int again = 0; again <= most_again; ++again) {
    out.options.doubt_base = again < most_again;
    out.options.tick = [&](const std::string& stage, double f) {
      options.tick(stage, begun + (0.9 - begun) * f);
    };
    out.naming = find_names(misfit, fine, out.base, out.options);
    if (!out.naming.better_base) break;
    out.base = *std::move(out.naming.better_base);
    begun += 0.5 * (0.9 - begun);
  }
  out.options.tick = {};
  out.judgement = judge(out.naming, out.options, out.samples);
  const auto verdict = out.judgement.verdict;
  if (verdict == Verdict::named || verdict == Verdict::ambiguous)
    out.best = out.judgement.trials.front().first;
  for (const auto& [trial, probability] : out.judgement.trials)
    health.numerical_error_over_noise = std::max(health.numerical_error_over_noise, trial->numerical_error);
  if (health.numerical_error_over_noise > 0.05)
    health.warnings.emplace_back(
        "The noise is so low that the simulations' own error shows in the residuals.");
  return out;
}

void tell(const Search& s, Discovery& out) {
  out.verdict = s.judgement.verdict;
  out.probability_unknown = s.judgement.probability_unknown;
  out.probability_nothing = s.judgement.probability_nothing;
  if (out.verdict != Verdict::nothing_missing)
    for (const auto& [trial, probability] : s.judgement.trials)
      out.explanations.push_back({estimates(*trial), probability, {}});
  if (out.verdict == Verdict::unknown && s.judgement.doubted != nullptr)
    out.doubted = estimates(*s.judgement.doubted);
  if (s.best != nullptr) out.family = s.best->effects.front()->family;
  out.recalibrated = recalibrations(s.after());
  out.recalibrated_base = model_at(s.base, "Recalibrated.");
  out.improved = s.best != nullptr ? model_at(s.best->fit, "Recalibrated, with what was found missing.")
                                   : out.recalibrated_base;
  detectable(out, s);
  equivalences(out, s.naming, s.samples, 20);
  for (const auto& t : s.naming.trials) {
    if (!t.checked || (s.best != nullptr && &t != s.best)) continue;
    out.health.largest_left = t.left;
    out.health.allowed_left = allowed_left(s.options, t.drop);
    break;
  }
}

}  // namespace ferrobench::model::discrepancy

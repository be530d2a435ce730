#include "model/discrepancy/naming.h"

#include <algorithm>
#include <cmath>
#include <set>

namespace ferrobench::model::discrepancy {
namespace {

constexpr std::size_t most_refits = 10, most_firsts = 2, most_best = 3, most_seconds = 4, most_pairs = 3;
constexpr double small_against = 0.0025;
constexpr double astray = 1.2;          // sum of squares over their number
constexpr double far_from_enough = 10;  // times what may be left

std::vector<const Effect*> without(const std::vector<const Effect*>& all,
                                   const std::vector<const Effect*>& some) {
  std::vector<const Effect*> out;
  for (const auto* e : all)
    if (std::ranges::find(some, e) == some.end()) out.push_back(e);
  return out;
}

// The base parameters as given, effects as they stand.
Eigen::VectorXd base_at_rest(const Hypothesis& hypothesis, const Fit& from) {
  auto z = at_rest(hypothesis);
  for (auto i = static_cast<Eigen::Index>(hypothesis.base_count); i < from.z.size(); ++i) z[i] = from.z[i];
  return z;
}

Trial refit(const Misfit& misfit, const Fit& from, const Fit& base, const Screened& s,
            const std::vector<const Effect*>& before, const FitLimits& limits) {
  Trial out;
  out.effects = before;
  out.effects.push_back(s.effect);
  const auto hypothesis = with_effect(from.hypothesis, *s.effect, s.values);
  if (from.squares > astray * static_cast<double>(misfit.size())) {
    // Without the effect the parameters may have gone far astray; with it, what was given is the better
    // start.
    auto from_rest = limits;
    from_rest.refreshes = 2;
    out.fit = fit(misfit, hypothesis, base_at_rest(hypothesis, from), from_rest);
  } else {
    auto z = at_rest(hypothesis);
    z.head(from.z.size()) = from.z - Projection(from).taken(s.response + from.residual);
    // The priors pull too; the fit sorts that out. Where the linear guess is wild, start where the base
    // stands.
    if ((z.head(from.z.size()) - from.z).cwiseAbs().maxCoeff() > 5) z.head(from.z.size()) = from.z;
    out.fit = fit(misfit, hypothesis, z, limits, &from);
  }
  out.drop = base.squares - out.fit.squares;
  return out;
}

}  // namespace

double allowed_left(const NamingOptions& options, double drop) {
  return std::max(options.second, small_against * drop);
}

double score(const Trial& t, double samples) {
  double numbers = 0;
  for (const auto* e : t.effects) numbers += static_cast<double>(e->parameters.size());
  return t.drop - numbers * std::log(samples);
}

Naming find_names(const Misfit& misfit, const Misfit& fine, const Fit& base, const NamingOptions& options) {
  Naming out;
  const auto tick = [&](const std::string& stage, double fraction) {
    if (options.tick) options.tick(stage, fraction);
  };
  const auto samples = static_cast<double>(misfit.size());
  out.excess = base.squares / samples - 1;
  out.screened = screen(misfit, base, {.effects = options.candidates, .tick = [&](double f) {
                                         tick("trying every effect", 0.3 * f);
                                       }});
  // To the end, with the simulations' own error taken out where the fit stands; unless it is plain already
  // that this is no explanation.
  const auto polish = [&](Trial& t, const std::function<void()>& in_between) {
    if (t.polished) return;
    correct(misfit, fine, t.fit);
    refresh(misfit, t.fit);
    t.drop = base.squares - t.fit.squares;
    if (!options.beyond_effects ||
        options.beyond_effects(t.fit) < far_from_enough * allowed_left(options, t.drop)) {
      settle(misfit, fine, t.fit, in_between);
      t.drop = base.squares - t.fit.squares;
    }
    t.polished = true;
  };
  // Fills in what is left after a trial; gives the effects that would take most of it.
  const auto check = [&](Trial& t, bool seconds_wanted, double from, double to) {
    if (t.checked) return std::vector<Screened>{};
    polish(t, [&] { tick("is it enough", from); });
    t.checked = true;
    if (options.beyond_effects) t.left = std::max(t.left, options.beyond_effects(t.fit));
    if (!seconds_wanted && t.left > allowed_left(options, t.drop)) return std::vector<Screened>{};
    auto more = screen(misfit, t.fit,
                       {.effects = without(options.candidates, t.effects),
                        .rounds = 3,
                        .before = out.screened,
                        .tick = [&](double f) { tick("is it enough", from + (to - from) * f); }});
    if (!more.empty()) t.left = std::max(t.left, more.front().drop);
    return more;
  };

  FitLimits limits{.iterations = 10, .refreshes = 1, .enough = 1, .tick = {}};
  for (std::size_t i = 0; i < std::min(most_refits, out.screened.size()); ++i) {
    const auto& s = out.screened[i];
    if (s.values.empty() || s.drop < 0.3 * options.detect || s.drop < 0.02 * out.screened.front().drop) break;
    limits.tick = [&, i] {
      tick("refitting " + std::string(s.effect->id), 0.3 + 0.02 * static_cast<double>(i));
    };
    out.trials.push_back(refit(misfit, base, base, s, {}, limits));
  }
  const auto best_first = [&] {
    std::ranges::stable_sort(
        out.trials, [&](const Trial& a, const Trial& b) { return score(a, samples) > score(b, samples); });
  };
  best_first();
  out.detected = !out.trials.empty() && score(out.trials.front(), samples) > options.detect;
  if (!out.detected) return out;

  // Which is best is told by those near the top, fitted to the end.
  const double near = std::max(3 * options.second, 0.05 * out.trials.front().drop);
  const double top = score(out.trials.front(), samples);
  for (std::size_t i = 0; i < std::min(out.trials.size(), most_best); ++i)
    if (i == 0 || score(out.trials[i], samples) > top - near)
      polish(out.trials[i], [&] { tick("comparing the best", 0.5); });
  best_first();

  // Is one effect enough? The best, and those as good as it.
  std::vector<std::vector<Screened>> seconds;
  const std::size_t singles = std::min(out.trials.size(), most_firsts);
  bool enough = false;
  for (std::size_t i = 0; i < singles; ++i) {
    auto& t = out.trials[i];
    if (i > 0 && enough && score(t, samples) < score(out.trials[0], samples) - options.second) break;
    seconds.push_back(
        check(t, true, 0.5 + 0.05 * static_cast<double>(i), 0.55 + 0.05 * static_cast<double>(i)));
    enough = enough || t.left < allowed_left(options, t.drop);
  }
  if (!enough) {
    std::vector<Trial> pairs;
    std::set<std::set<std::string_view>> tried;
    const std::size_t firsts = seconds.size();
    for (std::size_t i = 0; i < firsts; ++i) {
      for (std::size_t k = 0; k < std::min(most_seconds, seconds[i].size()); ++k) {
        const auto& s = seconds[i][k];
        if (s.values.empty() || s.drop < options.second) break;
        if (!tried.insert({out.trials[i].effects[0]->id, s.effect->id}).second) continue;
        limits.tick = [&] {
          tick("two effects: " + std::string(out.trials[i].effects[0]->id) + " and " +
                   std::string(s.effect->id),
               0.65 + 0.2 * static_cast<double>(tried.size()) / static_cast<double>(firsts * most_seconds));
        };
        pairs.push_back(refit(misfit, out.trials[i].fit, base, s, out.trials[i].effects, limits));
      }
    }
    std::ranges::stable_sort(
        pairs, [&](const Trial& a, const Trial& b) { return score(a, samples) > score(b, samples); });
    for (std::size_t i = 0; i < std::min(most_pairs, pairs.size()); ++i) {
      check(pairs[i], false, 0.85 + 0.04 * static_cast<double>(i), 0.89 + 0.04 * static_cast<double>(i));
      if (pairs[i].left < allowed_left(options, pairs[i].drop)) break;
    }
    out.trials.insert(out.trials.end(), std::make_move_iterator(pairs.begin()),
                      std::make_move_iterator(pairs.end()));
    best_first();
  }
  return out;
}

}  // namespace ferrobench::model::discrepancy

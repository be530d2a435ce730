#include "model/discrepancy/naming.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <set>

namespace ferrobench::model::discrepancy {
namespace {

constexpr std::size_t most_refits = 10, most_firsts = 2, most_best = 3, most_seconds = 4, most_pairs = 3,
                      most_rested = 3;
constexpr double small_against = 1e-4;
constexpr double astray = 1.2;          // sum of squares over their number
constexpr double most_squares = 1.2;    // likewise: the noise's level is estimated to a few percent
constexpr double far_from_enough = 10;  // times what may be left
constexpr double far_worse = 3;         // a sum of squares than another

std::vector<const Effect*> without(const std::vector<const Effect*>& all,
                                   const std::vector<const Effect*>& some) {
  std::vector<const Effect*> out;
  for (const auto* e : all)
    if (std::ranges::find(some, e) == some.end()) out.push_back(e);
  return out;
}

using Starts = std::vector<std::vector<double>>;

// Weaker and stronger, and of other shapes.
Starts starts_around(const Effect& effect, const std::vector<double>& values) {
  const Amplitude amplitude(effect.parameters.front());
  Starts out;
  for (const double factor : {1.0, 0.3, 3.0, 0.1}) {
    out.push_back(values);
    out.back().front() = amplitude.value(factor * amplitude.strength(values.front()));
  }
  for (std::size_t k = 1; k < values.size(); ++k)
    for (const double factor : {0.2, 5.0}) {
      if (effect.parameters[k].name == "frequency") continue;
      out.push_back(values);
      out.back()[k] *= factor;
    }
  return out;
}

// Over the plausible range.
Starts starts_of(const Effect& effect) {
  const Amplitude amplitude(effect.parameters.front());
  std::vector<double> values;
  for (const auto& p : effect.parameters) values.push_back(std::sqrt(p.low * p.high));
  Starts out;
  for (const double share : {0.2, 0.5, 0.8}) {
    values.front() = amplitude.value(amplitude.weak * std::pow(amplitude.strong / amplitude.weak, share));
    out.push_back(values);
    if (!amplitude.any_sign) continue;
    out.push_back(values);
    out.back().front() *= -1;
  }
  return out;
}

bool of_the_material(const Effect& e) {
  return e.family == Family::kinetics || e.family == Family::strain || e.family == Family::polarization ||
         e.family == Family::equilibrium;
}

class Namer {
 public:
  Namer(const Misfit& misfit, const Misfit& fine, const Fit& base, const NamingOptions& options)
      : misfit_(misfit),
        fine_(fine),
        base_(base),
        options_(options),
        samples_(static_cast<double>(misfit.size())) {}
  Naming find();

 private:
  void tick(const std::string& stage, double fraction) const {
    if (options_.tick) options_.tick(stage, fraction);
  }
  FitLimits limits(int refreshes, const std::string& stage, double fraction) const {
    return {.iterations = 10, .refreshes = refreshes, .enough = 1, .tick = [this, stage, fraction] {
              tick(stage, fraction);
            }};
  }
  double allowed(const Trial& t) const { return allowed_left(options_, t.drop); }
  bool is_enough(const Trial& t) const { return t.checked && t.left < allowed(t); }
  void best_first(std::vector<Trial>& trials) const {
    std::ranges::stable_sort(trials, std::greater<>(), [&](const Trial& t) { return score(t, samples_); });
  }

  Fit rest_of(const Fit& from);
  Fit from_rest(const Fit& rest, const Effect& effect, const Starts& starts, const FitLimits& limits,
                double rival) const;
  Trial refit(const Fit& from, const std::vector<const Effect*>& before, const Screened& s,
              const FitLimits& limits, const std::vector<Trial>& rivals);
  Trial alone(const Trial& pair, std::size_t which) const;
  void polish(Trial& t, const std::function<void()>& in_between) const;
  std::vector<Screened> check(Trial& t, bool seconds_wanted, double from, double to) const;
  void try_singles();
  void compare_the_best();
  void try_from_rest();
  void try_pairs(const std::vector<std::vector<Screened>>& seconds);
  void try_alone();

  const Misfit& misfit_;
  const Misfit& fine_;
  const Fit& base_;
  const NamingOptions& options_;
  double samples_;
  std::optional<Fit> rest_;            // of the base
  std::set<const Effect*> from_rest_;  // singles that were fitted from there
  Naming out_;
};

// The base parameters as given, effects as they stand: without an effect that is there the parameters may
// have gone far astray, and with it, what was given is the better start.
Fit Namer::rest_of(const Fit& from) {
  if (&from == &base_ && rest_) return *rest_;
  Fit f = from;
  f.z.head(static_cast<Eigen::Index>(from.hypothesis.base_count)).setZero();
  f.residual = f.corrected(misfit_.residuals(f.hypothesis, f.z));
  refresh(misfit_, f);
  if (&from == &base_) rest_ = f;
  return f;
}

// A few steps from each start; from the best to the end, unless it is far worse than `rival`, a sum of
// squares.
Fit Namer::from_rest(const Fit& rest, const Effect& effect, const Starts& starts, const FitLimits& limits,
                     double rival) const {
  std::optional<Fit> best;
  for (const auto& values : starts) {
    const auto hypothesis = with_effect(rest.hypothesis, effect, values);
    auto z = at_rest(hypothesis);
    z.head(rest.z.size()) = rest.z;
    auto f = fit(misfit_, hypothesis, z, {.iterations = 5, .refreshes = 0, .enough = 1, .tick = limits.tick},
                 &rest);
    if (!best || f.squares < best->squares) best = std::move(f);
  }
  if (best->squares > far_worse * rival) return *std::move(best);
  return fit(misfit_, best->hypothesis, best->z, limits, &*best);
}

Trial Namer::refit(const Fit& from, const std::vector<const Effect*>& before, const Screened& s,
                   const FitLimits& limits, const std::vector<Trial>& rivals) {
  Trial out;
  out.effects = before;
  out.effects.push_back(s.effect);
  if (from.squares > astray * samples_) {
    double rival = std::numeric_limits<double>::infinity();
    for (const auto& t : rivals) rival = std::min(rival, t.fit.squares);
    // A second one was screened beside the first, so its strength is about right.
    const auto starts = before.empty() ? starts_around(*s.effect, s.values) : Starts{s.values};
    out.fit = from_rest(rest_of(from), *s.effect, starts, limits, rival);
    if (before.empty()) from_rest_.insert(s.effect);
  } else {
    const auto hypothesis = with_effect(from.hypothesis, *s.effect, s.values);
    auto z = at_rest(hypothesis);
    z.head(from.z.size()) = from.z - Projection(from).taken(s.response + from.residual);
    // The priors pull too; the fit sorts that out. Where the linear guess is wild, start where the base
    // stands.
    if ((z.head(from.z.size()) - from.z).cwiseAbs().maxCoeff() > 5) z.head(from.z.size()) = from.z;
    out.fit = fit(misfit_, hypothesis, z, limits, &from);
  }
  out.drop = base_.squares - out.fit.squares;
  return out;
}

// One of a pair without the other, from where the pair stands.
Trial Namer::alone(const Trial& pair, std::size_t which) const {
  Trial out;
  out.effects = {pair.effects[which]};
  const auto& h = pair.fit.hypothesis;
  std::vector<double> values;
  std::size_t i = h.base_count;
  for (std::size_t k = 0; k < which; ++k) i += pair.effects[k]->parameters.size();
  for (std::size_t k = 0; k < out.effects[0]->parameters.size(); ++k, ++i)
    values.push_back(h.coordinates[i].value(pair.fit.z[static_cast<Eigen::Index>(i)]));
  const auto hypothesis = with_effect(base_.hypothesis, *out.effects[0], values);
  auto z = at_rest(hypothesis);
  z.head(static_cast<Eigen::Index>(h.base_count)) = pair.fit.z.head(static_cast<Eigen::Index>(h.base_count));
  Fit like{.hypothesis = base_.hypothesis,
           .z = {},
           .residual = {},
           .correction = pair.fit.correction,
           .jacobian = {}};
  like.jacobian = pair.fit.jacobian.leftCols(static_cast<Eigen::Index>(h.base_count));
  out.fit =
      fit(misfit_, hypothesis, z, limits(1, "one effect: " + std::string(out.effects[0]->id), 0.9), &like);
  out.drop = base_.squares - out.fit.squares;
  return out;
}

// To the end, with the simulations' own error taken out where the fit stands; unless it is plain already that
// this is no explanation.
void Namer::polish(Trial& t, const std::function<void()>& in_between) const {
  if (t.polished) return;
  correct(misfit_, fine_, t.fit);
  refresh(misfit_, t.fit);
  t.drop = base_.squares - t.fit.squares;
  if (!options_.beyond_effects || options_.beyond_effects(t.fit) < far_from_enough * allowed(t)) {
    settle(misfit_, fine_, t.fit, in_between);
    t.drop = base_.squares - t.fit.squares;
  }
  t.polished = true;
}

// Fills in what is left after a trial; gives the effects that would take most of it.
std::vector<Screened> Namer::check(Trial& t, bool seconds_wanted, double from, double to) const {
  if (t.checked) return {};
  polish(t, [&] { tick("is it enough", from); });
  t.checked = true;
  if (options_.beyond_effects)
    t.left = std::max(options_.beyond_effects(t.fit), t.fit.squares - most_squares * samples_);
  if (!seconds_wanted && t.left > allowed(t)) return {};
  auto more = screen(misfit_, t.fit,
                     {.effects = without(options_.candidates, t.effects),
                      .rounds = 3,
                      .before = out_.screened,
                      .tick = [&](double f) { tick("is it enough", from + (to - from) * f); }});
  if (!more.empty()) t.left = std::max(t.left, more.front().drop);
  return more;
}

void Namer::try_singles() {
  for (std::size_t i = 0; i < std::min(most_refits, out_.screened.size()); ++i) {
    const auto& s = out_.screened[i];
    if (s.values.empty() || s.drop < 0.3 * options_.detect || s.drop < 0.02 * out_.screened.front().drop)
      break;
    out_.trials.push_back(
        refit(base_, {}, s,
              limits(1, "refitting " + std::string(s.effect->id), 0.3 + 0.02 * static_cast<double>(i)),
              out_.trials));
  }
  best_first(out_.trials);
}

// Which is best is told by those near the top, fitted to the end.
void Namer::compare_the_best() {
  const double near = std::max(3 * options_.second, 0.05 * out_.trials.front().drop);
  const double top = score(out_.trials.front(), samples_);
  for (std::size_t i = 0; i < std::min(out_.trials.size(), most_best); ++i)
    if (i == 0 || score(out_.trials[i], samples_) > top - near)
      polish(out_.trials[i], [&] { tick("comparing the best", 0.5); });
  best_first(out_.trials);
}

// Around a base that has made up for an effect of the material, that effect may seem to be no help.
void Namer::try_from_rest() {
  const Fit rest = rest_of(base_);
  std::vector<Trial> rested;
  const auto stage = limits(2, "starting again from what was given", 0.98);
  for (const auto* e : options_.candidates) {
    if (!of_the_material(*e) || from_rest_.contains(e)) continue;
    Trial t;
    t.effects = {e};
    t.fit = from_rest(rest, *e, starts_of(*e), stage, 0);
    t.drop = base_.squares - t.fit.squares;
    rested.push_back(std::move(t));
  }
  best_first(rested);
  if (rested.size() > most_rested) rested.resize(most_rested);
  for (auto& t : rested) {
    t.fit = fit(misfit_, t.fit.hypothesis, t.fit.z, stage, &t.fit);
    t.drop = base_.squares - t.fit.squares;
  }
  best_first(rested);
  if (rested.empty() || score(rested.front(), samples_) < score(out_.trials.front(), samples_)) return;
  std::erase_if(out_.trials, [&](const Trial& t) { return t.effects == rested.front().effects; });
  out_.trials.insert(out_.trials.begin(), std::move(rested.front()));
  check(out_.trials.front(), false, 0.98, 0.99);
  best_first(out_.trials);
}

void Namer::try_pairs(const std::vector<std::vector<Screened>>& seconds) {
  std::vector<Trial> pairs;
  std::set<std::set<std::string_view>> tried;
  const std::size_t firsts = seconds.size();
  for (std::size_t i = 0; i < firsts; ++i) {
    for (std::size_t k = 0; k < std::min(most_seconds, seconds[i].size()); ++k) {
      const auto& s = seconds[i][k];
      if (s.values.empty() || s.drop < options_.second) break;
      const auto& first = out_.trials[i];
      if (!tried.insert({first.effects[0]->id, s.effect->id}).second) continue;
      const double done = static_cast<double>(tried.size()) / static_cast<double>(firsts * most_seconds);
      pairs.push_back(refit(
          first.fit, first.effects, s,
          limits(1, "two effects: " + std::string(first.effects[0]->id) + " and " + std::string(s.effect->id),
                 0.65 + 0.2 * done),
          pairs));
    }
  }
  best_first(pairs);
  for (std::size_t i = 0; i < std::min(most_pairs, pairs.size()); ++i) {
    check(pairs[i], false, 0.85 + 0.02 * static_cast<double>(i), 0.87 + 0.02 * static_cast<double>(i));
    if (is_enough(pairs[i])) break;
  }
  out_.trials.insert(out_.trials.end(), std::make_move_iterator(pairs.begin()),
                     std::make_move_iterator(pairs.end()));
  best_first(out_.trials);
}

// Of two, one may do what both do: its first fit only ended elsewhere.
void Namer::try_alone() {
  const auto pair = std::ranges::find_if(out_.trials, [](const Trial& t) { return t.effects.size() == 2; });
  if (pair == out_.trials.end()) return;
  std::vector<Trial> singles;
  for (const std::size_t which : {0, 1}) {
    auto t = alone(*pair, which);
    const bool better = std::ranges::none_of(out_.trials, [&](const Trial& other) {
      return other.effects == t.effects && other.fit.squares <= t.fit.squares + options_.second;
    });
    if (better) singles.push_back(std::move(t));
  }
  for (auto& t : singles) {
    check(t, false, 0.92, 0.98);
    // Then two are one too many.
    if (is_enough(t)) std::erase_if(out_.trials, [](const Trial& other) { return other.effects.size() > 1; });
    std::erase_if(out_.trials, [&](const Trial& other) { return other.effects == t.effects; });
    out_.trials.push_back(std::move(t));
  }
  best_first(out_.trials);
}

Naming Namer::find() {
  out_.excess = base_.squares / samples_ - 1;
  out_.screened = screen(misfit_, base_, {.effects = options_.candidates, .tick = [&](double f) {
                                            tick("trying every effect", 0.3 * f);
                                          }});
  try_singles();
  out_.detected = !out_.trials.empty() && score(out_.trials.front(), samples_) > options_.detect;
  if (!out_.detected) return std::move(out_);
  compare_the_best();

  // Is one effect enough? The best, and those as good as it.
  std::vector<std::vector<Screened>> seconds;
  const std::size_t firsts = std::min(out_.trials.size(), most_firsts);
  bool enough = false;
  for (std::size_t i = 0; i < firsts; ++i) {
    auto& t = out_.trials[i];
    if (i > 0 && enough && score(t, samples_) < score(out_.trials[0], samples_) - options_.second) break;
    seconds.push_back(
        check(t, true, 0.5 + 0.05 * static_cast<double>(i), 0.55 + 0.05 * static_cast<double>(i)));
    enough = enough || is_enough(t);
  }
  if (enough) return std::move(out_);
  try_pairs(seconds);
  try_alone();
  if (std::ranges::none_of(out_.trials, [&](const Trial& t) { return is_enough(t); })) try_from_rest();
  return std::move(out_);
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
  return Namer(misfit, fine, base, options).find();
}

}  // namespace ferrobench::model::discrepancy

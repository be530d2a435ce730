#include "model/discrepancy/naming.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <optional>
#include <set>
#include <utility>

namespace ferrobench::model::discrepancy {
namespace {

constexpr std::size_t most_refits = 10, most_firsts = 2, most_best = 3, most_seconds = 4, most_pairs = 3,
                      most_tried = 3;
// Of all starts, those that are gone on with after a step: of an effect, in all.
constexpr std::size_t most_of_each = 2, most_of_all = 12;
constexpr double astray = 1.2;        // sum of squares over their number
constexpr double most_squares = 1.2;  // likewise: the noise's level is estimated to a few percent
constexpr double far_worse = 2;       // a sum of squares than another
// Times what may be left: what is further from enough is not fitted to the end, nor searched on.
constexpr double within_reach = 30, hopeless = 1000;
// Likewise: so much is not made good by the end of a fit whose prospect is so many times less.
constexpr double too_much = 3, slow = 10;
// Of what can be detected: so much better a base is another one.
constexpr double worth = 0.2;

std::vector<const Effect*> without(const std::vector<const Effect*>& all,
                                   const std::vector<const Effect*>& some) {
  std::vector<const Effect*> out;
  for (const auto* e : all)
    if (std::ranges::find(some, e) == some.end()) out.push_back(e);
  return out;
}

using Starts = std::vector<std::vector<double>>;

// An effect, and where its parameters stand at first.
struct Start {
  const Effect* effect = nullptr;
  std::vector<double> values;
};

std::vector<Start> of(const Effect& effect, Starts starts) {
  std::vector<Start> out;
  for (auto& values : starts) out.push_back({&effect, std::move(values)});
  return out;
}

// Limits at what was reached; none for other effects.
Starts limits_in(const Misfit& misfit, const Effect& effect, std::vector<double> values) {
  Starts out;
  for (const double limit : misfit.limits(effect.parameters.front())) {
    values.front() = limit;
    out.push_back(values);
  }
  return out;
}

// Weaker and stronger, and of other shapes.
Starts starts_around(const Misfit& misfit, const Effect& effect, const std::vector<double>& values) {
  const Amplitude amplitude(effect.parameters.front());
  Starts out = limits_in(misfit, effect, values);
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
Starts starts_of(const Misfit& misfit, const Effect& effect) {
  const Amplitude amplitude(effect.parameters.front());
  std::vector<double> values;
  for (const auto& p : effect.parameters) values.push_back(std::sqrt(p.low * p.high));
  Starts out = limits_in(misfit, effect, values);
  if (!out.empty()) return out;
  for (const double share : {0.2, 0.5, 0.8}) {
    values.front() = amplitude.value(amplitude.weak * std::pow(amplitude.strong / amplitude.weak, share));
    out.push_back(values);
    if (!amplitude.any_sign) continue;
    out.push_back(values);
    out.back().front() *= -1;
  }
  return out;
}

void make_plausible(const Effect& effect, std::vector<double>& values) {
  for (std::size_t k = 0; k < values.size(); ++k) {
    const auto& p = effect.parameters[k];
    values[k] = std::copysign(std::clamp(std::abs(values[k]), p.low, p.high), values[k]);
  }
}

// The first ones of each.
void keep_of_each(std::vector<Trial>& trials, std::size_t most) {
  std::map<std::vector<const Effect*>, std::size_t> seen;
  std::erase_if(trials, [&](const Trial& t) { return ++seen[t.effects] > most; });
}

class Namer {
 public:
  Namer(const Misfit& misfit, Misfit& fine, const Fit& base, const NamingOptions& options)
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
  static FitLimits steps(int count, const std::function<void()>& in_between) {
    return {.iterations = count, .refreshes = 0, .enough = 1, .tick = in_between};
  }
  double allowed(const Trial& t) const { return allowed_left(options_, t.drop); }
  bool is_enough(const Trial& t) const { return t.checked && t.left < allowed(t); }
  bool far_off(const Trial& t, double times) const { return !t.checked || t.left > times * allowed(t); }
  void best_first(std::vector<Trial>& trials) const {
    std::ranges::stable_sort(trials, std::greater<>(), [&](const Trial& t) { return score(t, samples_); });
  }

  const Fit& rest_of(const Fit& from);
  std::vector<Trial> begin(const Fit& from, const std::vector<const Effect*>& before,
                           const std::vector<Start>& starts, std::size_t of_each,
                           const std::function<void()>& in_between) const;
  Fit from_base(const Fit& from, const Screened& s, const FitLimits& limits) const;
  void refit(std::vector<Trial>& into, const Fit& from, const std::vector<const Effect*>& before,
             const Screened& s, const FitLimits& limits);
  void go_on(std::vector<Trial>& trials, const FitLimits& limits) const;
  Fit reduced(const Trial& t, std::optional<std::size_t> kept, const FitLimits& limits) const;
  Trial alone(const Trial& pair, std::size_t which) const;
  bool base_does_better();
  void polish(Trial& t, const std::function<void()>& in_between) const;
  std::vector<Screened> check(Trial& t, bool seconds_wanted, double from, double to) const;
  void try_singles();
  void detect() {
    out_.detected = !out_.trials.empty() && score(out_.trials.front(), samples_) > options_.detect;
  }
  void compare_the_best();
  void add_pairs(const Trial& first, const std::vector<Screened>& seconds, double from, double to);
  bool check_pairs(double from, double to);
  bool try_halves(bool found);
  void try_every_effect(const Trial* first);

  const Misfit& misfit_;
  Misfit& fine_;
  const Fit& base_;
  const NamingOptions& options_;
  double samples_;
  std::optional<Fit> rest_;  // of the fit with this sum of squares
  double rest_from_ = 0;
  std::set<const Effect*> from_rest_;           // singles that were fitted from there
  std::vector<Trial> pairs_;                    // best first
  std::set<std::set<std::string_view>> tried_;  // of them
  Naming out_;
};

// The base parameters as given, effects as they stand: without an effect that is there the parameters may
// have gone far astray, and with it, what was given is the better start.
const Fit& Namer::rest_of(const Fit& from) {
  if (rest_ && rest_from_ == from.squares) return *rest_;
  rest_from_ = from.squares;
  rest_ = from;
  rest_->z.head(static_cast<Eigen::Index>(from.hypothesis.base_count)).setZero();
  correct(misfit_, fine_, *rest_);
  refresh(misfit_, *rest_);
  return *rest_;
}

// A step from each start, two more from those that are best then, so many of each effect. Best first.
std::vector<Trial> Namer::begin(const Fit& from, const std::vector<const Effect*>& before,
                                const std::vector<Start>& starts, std::size_t of_each,
                                const std::function<void()>& in_between) const {
  std::vector<Trial> out(starts.size());
  in_parallel(starts.size(), misfit_.threads(), [&](std::size_t i) {
    const auto hypothesis = with_effect(from.hypothesis, *starts[i].effect, starts[i].values);
    auto z = at_rest(hypothesis);
    z.head(from.z.size()) = from.z;
    const auto stepped = fit(misfit_, hypothesis, z, steps(1, in_between), &from);
    auto& t = out[i];
    t.effects = before;
    t.effects.push_back(starts[i].effect);
    t.fit.hypothesis = hypothesis;  // no more: there are many
    t.fit.z = stepped.z;
    t.drop = base_.squares - stepped.squares;
  });
  best_first(out);
  keep_of_each(out, of_each);
  if (out.size() > most_of_all) out.resize(most_of_all);
  in_parallel(out.size(), misfit_.threads(), [&](std::size_t i) {
    auto& t = out[i];
    t.fit = fit(misfit_, t.fit.hypothesis, t.fit.z, steps(2, in_between), &from);
    t.drop = base_.squares - t.fit.squares;
  });
  best_first(out);
  return out;
}

// From where the base stands, with what the parameters would give up for the effect.
Fit Namer::from_base(const Fit& from, const Screened& s, const FitLimits& limits) const {
  const auto hypothesis = with_effect(from.hypothesis, *s.effect, s.values);
  auto z = at_rest(hypothesis);
  z.head(from.z.size()) = from.z - Projection(from).taken(s.response + from.residual);
  // The priors pull too; the fit sorts that out. Where the linear guess is wild, start where the base
  // stands.
  if ((z.head(from.z.size()) - from.z).cwiseAbs().maxCoeff() > 5) z.head(from.z.size()) = from.z;
  return fit(misfit_, hypothesis, z, limits, &from);
}

// One more effect on `from`. Where that is astray: from there and from what was given, both only begun.
void Namer::refit(std::vector<Trial>& into, const Fit& from, const std::vector<const Effect*>& before,
                  const Screened& s, const FitLimits& limits) {
  const auto add = [&](Fit f, bool begun) {
    auto& t = into.emplace_back();
    t.effects = before;
    t.effects.push_back(s.effect);
    t.fit = std::move(f);
    t.drop = base_.squares - t.fit.squares;
    t.begun = begun;
  };
  const auto best_of = [&](Starts starts) {
    const auto of_each = options_.few ? most_of_all : most_of_each;
    return begin(rest_of(from), before, of(*s.effect, std::move(starts)), of_each, limits.tick).front().fit;
  };
  if (from.squares < astray * samples_) return add(from_base(from, s, limits), false);
  if (options_.few) {
    auto starts = starts_around(misfit_, *s.effect, s.values);
    std::ranges::move(starts_of(misfit_, *s.effect), std::back_inserter(starts));
    for (auto& values : starts) make_plausible(*s.effect, values);
    const auto begun = best_of(std::move(starts));
    auto to_the_end = limits;  // tables are simulated in milliseconds
    to_the_end.iterations = 40;
    to_the_end.refreshes = 6;
    return add(fit(misfit_, begun.hypothesis, begun.z, to_the_end, &begun), false);
  }
  add(from_base(from, s, steps(3, limits.tick)), true);
  // A second one was screened beside the first, so its strength is about right.
  add(best_of(before.empty() ? starts_around(misfit_, *s.effect, s.values) : Starts{s.values}), true);
  if (before.empty()) from_rest_.insert(s.effect);
}

// Goes on with those that are only begun, unless they are far worse than the best, and keeps one of each.
void Namer::go_on(std::vector<Trial>& trials, const FitLimits& limits) const {
  best_first(trials);
  const double rival = trials.empty() ? 0 : trials.front().fit.squares;
  for (auto& t : trials) {
    if (!std::exchange(t.begun, false) || t.fit.squares > far_worse * rival) continue;
    t.fit = fit(misfit_, t.fit.hypothesis, t.fit.z, limits, &t.fit);
    t.drop = base_.squares - t.fit.squares;
  }
  best_first(trials);
  keep_of_each(trials, 1);
}

// Where the parameters of a trial's effect stand.
std::vector<double> values_in(const Trial& t, std::size_t which) {
  const auto& h = t.fit.hypothesis;
  std::size_t i = h.base_count;
  for (std::size_t k = 0; k < which; ++k) i += t.effects[k]->parameters.size();
  std::vector<double> out;
  for (std::size_t k = 0; k < t.effects[which]->parameters.size(); ++k, ++i)
    out.push_back(h.coordinates[i].value(t.fit.z[static_cast<Eigen::Index>(i)]));
  return out;
}

// The base model from where a trial stands, with one of its effects or none.
Fit Namer::reduced(const Trial& t, std::optional<std::size_t> kept, const FitLimits& limits) const {
  const auto base_count = static_cast<Eigen::Index>(t.fit.hypothesis.base_count);
  const auto hypothesis =
      kept ? with_effect(base_.hypothesis, *t.effects[*kept], values_in(t, *kept)) : base_.hypothesis;
  auto z = at_rest(hypothesis);
  z.head(base_count) = t.fit.z.head(base_count);
  const Fit like{.hypothesis = base_.hypothesis,
                 .z = {},
                 .residual = {},
                 .correction = t.fit.correction,
                 .jacobian = t.fit.jacobian.leftCols(base_count)};
  return fit(misfit_, hypothesis, z, limits, &like);
}

// One of a pair without the other.
Trial Namer::alone(const Trial& pair, std::size_t which) const {
  Trial out;
  out.effects = {pair.effects[which]};
  out.fit = reduced(pair, which, limits(1, "one effect: " + std::string(out.effects[0]->id), 0.88));
  out.drop = base_.squares - out.fit.squares;
  return out;
}

// What an effect seems to explain, the base model may explain as well from where the effect led it.
bool Namer::base_does_better() {
  if (!options_.doubt_base || out_.trials.empty()) return false;
  const auto& best = out_.trials.front();
  if (best.fit.jacobian.size() == 0) return false;
  const auto stage = limits(0, "no effect", 0.5);
  auto none = reduced(best, std::nullopt, stage);
  const auto better = [&] { return none.squares < base_.squares - worth * options_.detect; };
  if (!better()) return false;
  correct(misfit_, fine_, none);
  settle(misfit_, fine_, none, stage.tick);
  if (!better()) return false;
  out_.better_base = std::move(none);
  return true;
}

// To the end, with the simulations' own error taken out where the fit stands; unless it is plain already that
// this is no explanation.
void Namer::polish(Trial& t, const std::function<void()>& in_between) const {
  if (t.polished) return;
  auto refined = refine(fine_, t.fit.hypothesis, t.fit.z, options_.most_domains);
  t.numerical_error = refined.error;
  correct(misfit_, std::move(refined.residual), t.fit);
  refresh(misfit_, t.fit);
  t.drop = base_.squares - t.fit.squares;
  t.polished = true;
  if (options_.beyond_effects) {
    const double left = options_.beyond_effects(t.fit) / allowed(t);
    if (left > within_reach || (left > too_much && allowed(t) * left > slow * t.fit.prospect())) return;
  }
  settle(misfit_, fine_, t.fit, in_between);
  t.drop = base_.squares - t.fit.squares;
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
  for (const auto& s : more) t.left = std::max(t.left, s.drop - price({s.effect}, samples_));
  return more;
}

void Namer::try_singles() {
  for (std::size_t i = 0; i < std::min(most_refits, out_.screened.size()); ++i) {
    const auto& s = out_.screened[i];
    if (s.values.empty() || s.drop < 0.3 * options_.detect || s.drop < 0.02 * out_.screened.front().drop)
      break;
    refit(out_.trials, base_, {}, s,
          limits(1, "refitting " + std::string(s.effect->id), 0.3 + 0.02 * static_cast<double>(i)));
  }
  go_on(out_.trials, limits(1, "refitting the best", 0.5));
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

// The parameters may have made up for what is missing in a way that leads away from it, and the screen,
// which is linear, not see it: every effect at plausible strengths, and everything refitted. As a second one
// beside `first` where that comes near, else from where the base stands or, if that is astray, from the
// parameters as given.
void Namer::try_every_effect(const Trial* first) {
  const std::vector<const Effect*> before = first != nullptr ? first->effects : std::vector<const Effect*>{};
  const bool gone_astray = base_.squares > astray * samples_;
  const Fit& from = first != nullptr ? first->fit : gone_astray ? rest_of(base_) : base_;
  const auto stage = limits(2,
                            first != nullptr ? "every effect beside the best"
                            : gone_astray    ? "starting again from what was given"
                                             : "every effect at plausible strengths",
                            0.95);
  std::vector<Start> starts;
  const auto start = [&](const Effect& e, Starts its) {
    if (before.empty() && !from_rest_.insert(&e).second) return;
    std::ranges::move(of(e, std::move(its)), std::back_inserter(starts));
  };
  if (before.empty())
    for (std::size_t i = 0; i < std::min(out_.trials.size(), most_best); ++i) {
      const auto& t = out_.trials[i];
      start(*t.effects[0], starts_around(misfit_, *t.effects[0], values_in(t, 0)));
    }
  for (const auto* e : without(options_.candidates, before)) start(*e, starts_of(misfit_, *e));
  auto tried = begin(from, before, starts, most_of_each, stage.tick);
  keep_of_each(tried, 1);
  if (tried.size() > most_tried) tried.resize(most_tried);
  for (auto& t : tried) {
    t.fit = fit(misfit_, t.fit.hypothesis, t.fit.z, stage, &t.fit);
    t.drop = base_.squares - t.fit.squares;
  }
  best_first(tried);
  auto& others = before.empty() ? out_.trials : pairs_;
  const auto worse = [&](const Trial& t) { return score(t, samples_) < score(tried.front(), samples_); };
  if (tried.empty() || !std::ranges::all_of(others, worse)) return;
  std::erase_if(others, [&](const Trial& t) { return t.effects == tried.front().effects; });
  others.push_back(std::move(tried.front()));
  check(others.back(), false, 0.97, 0.99);
  best_first(others);
}

void Namer::add_pairs(const Trial& first, const std::vector<Screened>& seconds, double from, double to) {
  const std::size_t most = std::min(most_seconds, seconds.size());
  for (std::size_t k = 0; k < most; ++k) {
    const auto& s = seconds[k];
    if (s.values.empty() || s.drop < options_.second) break;
    if (!tried_.insert({first.effects[0]->id, s.effect->id}).second) continue;
    const double done = static_cast<double>(k) / static_cast<double>(most);
    refit(pairs_, first.fit, first.effects, s,
          limits(1, "two effects: " + std::string(first.effects[0]->id) + " and " + std::string(s.effect->id),
                 from + (to - from) * done));
  }
  go_on(pairs_, limits(1, "refitting the best of two", to));
}

// True if one of the best of them is enough.
bool Namer::check_pairs(double from, double to) {
  std::size_t checked = 0;
  for (auto& pair : pairs_) {
    if (pair.checked) continue;
    if (checked == most_pairs) break;
    const double at = from + (to - from) * static_cast<double>(checked++) / most_pairs;
    check(pair, false, at, at + (to - from) / most_pairs);
    if (is_enough(pair)) return true;
  }
  return false;
}

// Of two, one may do what both do: its first fit only ended elsewhere. Or it may want another partner.
bool Namer::try_halves(bool found) {
  if (pairs_.empty() || far_off(pairs_.front(), hopeless)) return found;
  const Trial best = pairs_.front();
  const bool partners = !found && !far_off(best, within_reach);
  for (const std::size_t which : {0, 1}) {
    auto t = alone(best, which);
    const bool better = std::ranges::none_of(out_.trials, [&](const Trial& other) {
      return other.effects == t.effects && other.fit.squares <= t.fit.squares + options_.second;
    });
    if (!better && !partners) continue;
    const double at = 0.88 + 0.03 * static_cast<double>(which);
    const auto seconds = check(t, partners, at, at + 0.01);
    const bool enough = is_enough(t);
    if (enough) pairs_.clear();  // two are one too many
    if (partners && !enough) add_pairs(t, seconds, at + 0.01, at + 0.03);
    if (better) {
      std::erase_if(out_.trials, [&](const Trial& other) { return other.effects == t.effects; });
      out_.trials.push_back(std::move(t));
    }
    if (enough) return true;
  }
  return partners ? check_pairs(0.94, 0.95) : found;
}

Naming Namer::find() {
  out_.excess = base_.squares / samples_ - 1;
  out_.screened = screen(misfit_, base_, {.effects = options_.candidates, .tick = [&](double f) {
                                            tick("trying every effect", 0.3 * f);
                                          }});
  try_singles();
  detect();
  if (!out_.detected) {
    if (options_.beyond_effects) out_.left = options_.beyond_effects(base_);
    if (leaves_something(out_, options_) && !options_.few) {
      try_every_effect(nullptr);
      detect();
    }
    if (!out_.detected) {
      if (leaves_something(out_, options_)) base_does_better();
      return std::move(out_);
    }
  }
  compare_the_best();
  if (base_does_better()) return std::move(out_);

  // Is one effect enough? The best, and those as good as it.
  std::vector<std::vector<Screened>> seconds;
  const std::size_t firsts = std::min(out_.trials.size(), most_firsts);
  bool enough = false;
  for (std::size_t i = 0; i < firsts; ++i) {
    auto& t = out_.trials[i];
    if (i > 0 && enough && score(t, samples_) < score(out_.trials[0], samples_) - options_.second) break;
    const double at = 0.5 + 0.05 * static_cast<double>(i);
    seconds.push_back(check(t, true, at, at + 0.05));
    enough = enough || is_enough(t);
  }
  if (enough || options_.few) return std::move(out_);
  for (std::size_t i = 0; i < firsts; ++i) {
    const double at = 0.6 + 0.1 * static_cast<double>(i);
    add_pairs(out_.trials[i], seconds[i], at, at + 0.1);
  }
  const bool found = try_halves(check_pairs(0.8, 0.88));
  best_first(out_.trials);
  if (!found && !std::ranges::all_of(out_.trials, [&](const Trial& t) { return far_off(t, hopeless); }))
    try_every_effect(far_off(out_.trials.front(), within_reach) ? nullptr : &out_.trials.front());
  std::ranges::move(pairs_, std::back_inserter(out_.trials));
  best_first(out_.trials);
  return std::move(out_);
}

}  // namespace

bool leaves_something(const Naming& naming, const NamingOptions& options) {
  return naming.excess > plain_excess || naming.left > options.detect;
}

double allowed_left(const NamingOptions& options, double drop) {
  return std::max(options.second, options.small_against * drop);
}

double price(const std::vector<const Effect*>& effects, double samples) {
  double numbers = 0;
  for (const auto* e : effects) numbers += static_cast<double>(e->parameters.size());
  return numbers * std::log(samples);
}

double score(const Trial& t, double samples) {
  return t.drop - price(t.effects, samples);
}

Naming find_names(const Misfit& misfit, Misfit& fine, const Fit& base, const NamingOptions& options) {
  return Namer(misfit, fine, base, options).find();
}

}  // namespace ferrobench::model::discrepancy

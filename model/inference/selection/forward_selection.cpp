#include "model/inference/selection/forward_selection.h"

#include <algorithm>
#include <iterator>
#include <optional>
#include <set>
#include <string_view>
#include <utility>

#include "model/inference/selection/trial_fits.h"

namespace ferrobench::model::inference {
namespace {

std::vector<const Effect*> without(const std::vector<const Effect*>& all,
                                   const std::vector<const Effect*>& some) {
  std::vector<const Effect*> out;
  for (const auto* e : all)
    if (std::ranges::find(some, e) == some.end()) out.push_back(e);
  return out;
}

class ForwardSelector {
 public:
  ForwardSelector(const WhitenedResiduals& coarse, WhitenedResiduals& fine, const Fit& base,
                  const SelectionTask& task, const SelectionOptions& options)
      : coarse_(coarse),
        base_(base),
        task_(task),
        options_(options),
        fits_(coarse, fine, base, task, options),
        samples_(fits_.samples()) {}
  ForwardSelection find();

 private:
  bool is_enough(const Trial& t) const { return t.checked && t.left < fits_.allowed(t); }
  // Whether more than so many times what is allowed is left.
  bool far_off(const Trial& t, double times) const { return !t.checked || t.left > times * fits_.allowed(t); }
  void detect() {
    out_.detected = !out_.trials.empty() && delta_bic(out_.trials.front(), samples_) > options_.detection;
  }
  // Whether the answer hangs on what a base fit that is not at its end may still gain.
  bool base_decides(double drop) {
    out_.base_decides = !task_.base_is_final && drop < options_.unfinished_base * options_.detection;
    return out_.base_decides;
  }
  bool base_does_better() {
    if (task_.doubt_base && !out_.trials.empty()) out_.better_base = fits_.better_base(out_.trials.front());
    return out_.better_base.has_value();
  }
  std::vector<Screened> check(Trial& t, bool seconds_wanted, double from, double to) const;
  void try_singles();
  void compare_the_best(std::vector<Trial>& trials, double drop_before, double done);
  void add_pairs(const Trial& first, const std::vector<Screened>& seconds, double from, double to);
  bool check_pairs(double from, double to);
  bool try_halves(bool found);
  void try_every_effect(const Trial* first);

  const WhitenedResiduals& coarse_;
  const Fit& base_;
  const SelectionTask& task_;
  const SelectionOptions& options_;
  TrialFits fits_;
  double samples_;
  std::vector<Trial> pairs_;                    // best first
  std::set<std::set<std::string_view>> tried_;  // pairs of effects
  ForwardSelection out_;
};

// Finds what a trial leaves (Trial::left). Returns the effects that were screened for that, the one with the
// largest drop first. If `seconds_wanted` is false, they are only screened where that may still matter.
std::vector<Screened> ForwardSelector::check(Trial& t, bool seconds_wanted, double from, double to) const {
  if (t.checked && !seconds_wanted) return {};
  fits_.polish(t, [&] { fits_.tick("checking sufficiency", from); });
  t.checked = true;
  if (task_.beyond_effects)
    t.left = std::max(task_.beyond_effects(t.fit), t.fit.squares - (1 + options_.lack_of_fit) * samples_);
  if (!seconds_wanted && t.left > fits_.allowed(t)) return {};
  auto more = screen(coarse_, t.fit,
                     {.effects = without(task_.candidates, t.effects),
                      .rounds = 3,
                      .before = out_.screened,
                      .tick = [&](double f) { fits_.tick("checking sufficiency", from + (to - from) * f); }});
  for (const auto& s : more) t.left = std::max(t.left, s.drop - bic_penalty({s.effect}, samples_));
  return more;
}

void ForwardSelector::try_singles() {
  // Explanations do not depend on the base model's fit, only what they are compared with does.
  for (auto t : task_.known) {
    t.drop = base_.squares - t.fit.squares;
    t.checked = false;
    out_.trials.push_back(std::move(t));
  }
  for (std::size_t i = 0; i < std::min(options_.single_refits, out_.screened.size()); ++i) {
    const auto& s = out_.screened[i];
    if (s.values.empty() || s.drop < options_.refit_share_of_detection * options_.detection ||
        s.drop < options_.refit_share_of_best * out_.screened.front().drop)
      break;
    fits_.refit(out_.trials, base_, {}, s,
                fits_.solver("refitting " + std::string(s.effect->id), 0.3 + 0.02 * static_cast<double>(i)));
  }
  fits_.finish(out_.trials, fits_.solver("refitting the best", 0.5));
}

// Only fits that have come to their end can be compared, so those near the top are taken there. What is near
// is measured by what the trials' last effects take off, beyond the drop of what stood before them.
void ForwardSelector::compare_the_best(std::vector<Trial>& trials, double drop_before, double done) {
  if (trials.empty()) return;
  const double near = nearness(options_, trials.front().drop - drop_before);
  const double top = delta_bic(trials.front(), samples_);
  for (std::size_t i = 0; i < std::min(trials.size(), options_.compared); ++i)
    if (i == 0 || delta_bic(trials[i], samples_) > top - near)
      fits_.polish(trials[i], [&] { fits_.tick("comparing the best", done); });
  fits_.sort_best_first(trials);
}

// The parameters may have made up for what is missing in a way that leads away from it, which the screen,
// being linear, does not see. So every effect is refitted from plausible strengths: as a second one beside
// `first` if that is not null, else from where the base stands or, if the base is misled, from the parameters
// as given.
void ForwardSelector::try_every_effect(const Trial* first) {
  const std::vector<const Effect*> before = first != nullptr ? first->effects : std::vector<const Effect*>{};
  const bool misled = fits_.is_misled(base_);
  const Fit& from = first != nullptr ? first->fit : misled ? fits_.as_given(base_) : base_;
  const auto stage = fits_.solver(first != nullptr ? "every effect beside the best"
                                  : misled         ? "starting again from what was given"
                                                   : "every effect at plausible strengths",
                                  0.95);
  std::vector<EffectStart> starts;
  const auto start = [&](const Effect& e, Starts its) {
    if (before.empty() && !fits_.tried_as_given.insert(&e).second) return;
    std::ranges::move(starts_for(e, std::move(its)), std::back_inserter(starts));
  };
  if (before.empty())
    for (std::size_t i = 0; i < std::min(out_.trials.size(), options_.compared); ++i) {
      const auto& t = out_.trials[i];
      start(*t.effects[0], starts_around(coarse_, *t.effects[0], effect_values(t, 0)));
    }
  for (const auto* e : without(task_.candidates, before)) start(*e, plausible_starts(coarse_, *e));
  if (first != nullptr || !misled) starts = fits_.promising(from, starts, stage.tick);
  auto tried = fits_.begin(from, before, starts, options_.starts_per_effect, stage.tick);
  keep_of_each(tried, 1);
  if (tried.size() > options_.plausible_refits) tried.resize(options_.plausible_refits);
  for (auto& t : tried) {
    fits_.set_fit(t, minimize(coarse_, std::move(t.fit), stage));
  }
  fits_.sort_best_first(tried);
  auto& others = before.empty() ? out_.trials : pairs_;
  const auto worse = [&](const Trial& t) {
    return delta_bic(t, samples_) < delta_bic(tried.front(), samples_);
  };
  if (tried.empty() || !std::ranges::all_of(others, worse)) return;
  std::erase_if(others, [&](const Trial& t) { return t.effects == tried.front().effects; });
  others.push_back(std::move(tried.front()));
  check(others.back(), false, 0.97, 0.99);
  fits_.sort_best_first(others);
}

void ForwardSelector::add_pairs(const Trial& first, const std::vector<Screened>& seconds, double from,
                                double to) {
  const std::size_t most = std::min(options_.second_effects, seconds.size());
  for (std::size_t k = 0; k < most; ++k) {
    const auto& s = seconds[k];
    if (s.values.empty() || s.drop < options_.second_detection) break;
    if (!tried_.insert({first.effects[0]->id, s.effect->id}).second) continue;
    const double done = static_cast<double>(k) / static_cast<double>(most);
    fits_.refit(pairs_, first.fit, first.effects, s,
                fits_.solver(
                    "two effects: " + std::string(first.effects[0]->id) + " and " + std::string(s.effect->id),
                    from + (to - from) * done));
  }
  fits_.finish(pairs_, fits_.solver("refitting the best of two", to));
}

// Whether one of the best pairs is enough.
bool ForwardSelector::check_pairs(double from, double to) {
  compare_the_best(pairs_, out_.trials.front().drop, from);
  std::size_t checked = 0;
  for (auto& pair : pairs_) {
    if (pair.checked) continue;
    if (checked == options_.checked_pairs) break;
    const double at = from + (to - from) * static_cast<double>(checked++) / options_.checked_pairs;
    check(pair, false, at, at + (to - from) / options_.checked_pairs);
    if (is_enough(pair)) return true;
  }
  return false;
}

// One effect of a pair may explain alone what both do, if its first fit only ended elsewhere; or it may want
// another partner.
bool ForwardSelector::try_halves(bool found) {
  if (pairs_.empty() || far_off(pairs_.front(), options_.hopeless_remainder)) return found;
  const Trial best = pairs_.front();
  const bool partners = !found && !far_off(best, options_.reachable_remainder);
  for (const std::size_t which : {0, 1}) {
    auto t = fits_.alone(best, which);
    const bool better = std::ranges::none_of(out_.trials, [&](const Trial& other) {
      return other.effects == t.effects && other.fit.squares <= t.fit.squares + options_.second_detection;
    });
    if (!better && !partners) continue;
    const double at = 0.88 + 0.03 * static_cast<double>(which);
    const auto seconds = check(t, partners, at, at + 0.01);
    const bool enough = is_enough(t);
    if (enough) pairs_.clear();
    if (partners && !enough) add_pairs(t, seconds, at + 0.01, at + 0.03);
    if (better) {
      std::erase_if(out_.trials, [&](const Trial& other) { return other.effects == t.effects; });
      out_.trials.push_back(std::move(t));
    }
    if (enough) return true;
  }
  return partners ? check_pairs(0.94, 0.95) : found;
}

ForwardSelection ForwardSelector::find() {
  out_.excess = base_.squares / samples_ - 1;
  out_.screened = screen(coarse_, base_, {.effects = task_.candidates, .tick = [&](double f) {
                                            fits_.tick("trying every effect", 0.3 * f);
                                          }});
  if (base_decides(out_.screened.empty() ? 0 : out_.screened.front().drop)) return std::move(out_);
  try_singles();
  // The grain of the coarse simulation can hide a minimum that is hardly a detection.
  compare_the_best(out_.trials, 0, 0.5);
  if (base_decides(out_.trials.empty() ? 0 : delta_bic(out_.trials.front(), samples_)))
    return std::move(out_);
  detect();
  if (!out_.detected) {
    if (task_.beyond_effects) out_.left = task_.beyond_effects(base_);
    if (has_lack_of_fit(out_, options_) && !options_.single_effect) {
      try_every_effect(nullptr);
      compare_the_best(out_.trials, 0, 0.5);
      detect();
    }
    if (!out_.detected) {
      if (has_lack_of_fit(out_, options_)) base_does_better();
      return std::move(out_);
    }
  }
  if (base_does_better()) return std::move(out_);

  // Is one effect enough? The best is asked, and those as good as it.
  std::vector<std::vector<Screened>> seconds;
  const std::size_t firsts = std::min(out_.trials.size(), options_.first_effects);
  bool enough = false;
  for (std::size_t i = 0; i < firsts; ++i) {
    auto& t = out_.trials[i];
    if (i > 0 && enough &&
        delta_bic(t, samples_) < delta_bic(out_.trials[0], samples_) - options_.second_detection)
      break;
    const double at = 0.5 + 0.05 * static_cast<double>(i);
    seconds.push_back(check(t, true, at, at + 0.05));
    enough = enough || is_enough(t);
  }
  if (enough || options_.single_effect) return std::move(out_);
  for (std::size_t i = 0; i < firsts; ++i) {
    const double at = 0.6 + 0.1 * static_cast<double>(i);
    add_pairs(out_.trials[i], seconds[i], at, at + 0.1);
  }
  const bool found = try_halves(check_pairs(0.8, 0.88));
  fits_.sort_best_first(out_.trials);
  if (!found && !std::ranges::all_of(out_.trials,
                                     [&](const Trial& t) { return far_off(t, options_.hopeless_remainder); }))
    try_every_effect(far_off(out_.trials.front(), options_.reachable_remainder) ? nullptr
                                                                                : &out_.trials.front());
  std::ranges::move(pairs_, std::back_inserter(out_.trials));
  fits_.sort_best_first(out_.trials);
  return std::move(out_);
}

}  // namespace

ForwardSelection select_forward(const WhitenedResiduals& coarse, WhitenedResiduals& fine, const Fit& base,
                                const SelectionTask& task, const SelectionOptions& options) {
  return ForwardSelector(coarse, fine, base, task, options).find();
}

}  // namespace ferrobench::model::inference

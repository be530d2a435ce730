#include "model/inference/study/improvement.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "model/inference/selection/screening.h"
#include "model/inference/study/empirical_term.h"
#include "model/inference/study/incumbent.h"
#include "model/inference/study/workflow.h"

namespace ferrobench::model::inference {
namespace {

// Twice the logarithm of the odds that a term must earn beyond its numbers: 150 to 1.
constexpr double least_gain = 10;
// Least share of the excess that an effect and a table must take away if they are added without a name. An
// effect that takes less is no better than a table, and it shifts parameters that it has nothing to do with.
// A table need not take much. On the held-out recordings, which may show little of what it does, it has to
// take that much where noise is the only error, and must add nothing where the model has an error of its own.
constexpr double least_share_of_effect = 0.15, least_share_of_table = 0.02;
// Part of the material share that an effect must take in its first fit to be fitted to its end. The first fit
// uses a model error that was estimated without the effect and is as large as what the effect explains; the
// effect may take its whole share once the error is estimated with it.
constexpr double least_part_at_first = 0.5;
constexpr std::size_t most_named = 2, most_effects = 6, refits = 4;
// Approximate shares of the progress: of the search of the base's whole range, where one is made; of effects
// in what remains; and of a round of effects in what remains for these, as nobody knows how many rounds
// follow.
constexpr double share_of_search = 0.7, share_of_effects = 0.5, share_of_round = 0.5;
// Rounds in which pasts are chosen anew, each followed by a fit; they stay as they are after two.
constexpr int rounds_of_pasts = 2;

// An effect beside the base, fitted.
struct TriedEffect {
  const Effect* effect = nullptr;
  double gained = 0;  // 2 ln of the likelihood ratio, less what its numbers cost
  HypothesisPoint place;
  std::vector<protocols::Past> pasts{};  // of the bench; empty: those that stand
};

// Most probable first.
std::vector<std::pair<const Effect*, double>> probabilities(const std::vector<TriedEffect>& tried) {
  std::vector<std::pair<const Effect*, double>> out;
  double sum = 0, best = -std::numeric_limits<double>::infinity();
  for (const auto& t : tried) best = std::max(best, t.gained);
  for (const auto& t : tried) {
    out.emplace_back(t.effect, std::exp(0.5 * (t.gained - best)));
    sum += out.back().second;
  }
  for (auto& [effect, probability] : out) probability /= sum;
  std::ranges::stable_sort(out, std::greater<>(), [](const auto& r) { return r.second; });
  return out;
}

class Improver {
 public:
  Improver(const ImprovementTask& task, const Fit& base)
      : task_(task), incumbent_(task, base, [this](const std::string& stage) { tick(stage); }) {}

  Improvement run() {
    auto given = incumbent_.at();
    incumbent_.settle();
    if (!task_.presumed_past) settle_with_pasts(std::move(given));
    stand_as_base();
    out_.added = task_.named;
    if (out_.added.empty() && !incumbent_.noise_is_only_error()) name();
    out_.named = !out_.added.empty() && all_take_material_shares();
    out_.for_noise_to_judge =
        task_.until_noise_may_judge && !out_.added.empty() && !incumbent_.is_gross(incumbent_.at());
    if (!out_.for_noise_to_judge) reduce_the_rest();
    if (!task_.presumed_past && !out_.named && !out_.added.empty()) incumbent_.refit_under_other_pasts();
    const auto& [hypothesis, z] = incumbent_.at();
    // Beside the model's error, that is what the likelihood is tempered by.
    estimate_terms(incumbent_.fit(), hypothesis, z,
                   incumbent_.noise_is_only_error() ? task_.selection.likelihood_tempering : 1, out_.added);
    out_.hypothesis = hypothesis;
    out_.z = z;
    return std::move(out_);
  }

 private:
  bool takes_material_share(const AddedTerm& a) const {
    return std::min(a.share.value_or(1), a.share_held_out.value_or(1)) >= task_.selection.material_share;
  }
  bool all_take_material_shares() const {
    return std::ranges::all_of(out_.added, [this](const AddedTerm& a) { return takes_material_share(a); });
  }

  void stand_as_base() {
    out_.base = incumbent_.fit();
    out_.pasts_of_base = incumbent_.pasts();
  }

  // Pasts were chosen with the height of each channel free, as a model is given with constants that are not
  // the specimen's. One that was fitted before knows the heights, and so it tells pasts apart better.
  void settle_with_pasts(HypothesisPoint given) {
    const auto before = incumbent_.pasts();
    const auto under_given = fit_to_all(given);
    if (under_given && under_given->smaller_share() > 0)
      incumbent_.settle_at(std::move(given));
    else
      task_.set_pasts(before);
    for (int i = 0; i < rounds_of_pasts && incumbent_.choose_pasts(incumbent_.at()); ++i)
      incumbent_.settle(1);
  }

  void name() {
    auto remaining = task_.candidates;
    demanded_ = demanded_held_out_ = task_.selection.material_share;
    while (all_take_material_shares() && out_.added.size() < most_named && incumbent_.is_material() &&
           name_effect(remaining)) {
    }
  }

  void reduce_the_rest() {
    if (out_.added.empty())
      narrow();
    else if (incumbent_.is_material())
      narrow_beside_names();
    if (task_.tables_beside_corrections || std::ranges::none_of(out_.added, &AddedTerm::empirical))
      add_tables();
  }

  void narrow() {
    if (!incumbent_.noise_is_only_error()) incumbent_.settle_with_free_base();
    stand_as_base();
    auto remaining = task_.candidates;
    remaining.insert(remaining.end(), task_.corrections.begin(), task_.corrections.end());
    demanded_ = demanded_held_out_ = least_share_of_effect;
    search_again(remaining);
    const auto is_worth_more = [this] {
      return incumbent_.noise_is_only_error() || incumbent_.is_material();
    };
    while (!out_.named && out_.added.size() < most_effects && is_worth_more() && add_effect(remaining)) {
    }
  }

  // What is left beside effects that have a name, first by other kinetics, as these hold where tables may
  // not.
  void narrow_beside_names() {
    incumbent_.settle_with_trusted_instruments();
    auto remaining = task_.corrections;
    demanded_ = demanded_held_out_ = least_share_of_effect;
    while (incumbent_.is_material() && add_effect(remaining)) {
    }
  }

  // From the whole range of the base's parameters. A base alone claims nothing, and takes its place where it
  // is likelier and holds; an effect beside it is named if it takes as much as one that is found otherwise.
  void search_again(std::vector<const Effect*>& remaining) {
    if (!task_.search_bases || !incumbent_.is_material()) return;
    const auto found = task_.search_bases(
        setting_at(incumbent_.at().hypothesis, incumbent_.at().z).model, remaining, incumbent_.noise(),
        [&](const std::string& stage, double f) { task_.tick(stage, share_of_search * f); });
    if (!found.empty()) searched_ = share_of_search;
    std::vector<TriedEffect> tried;
    auto before = incumbent_.pasts();
    for (const auto& searched : found) {
      auto next = place_of(searched);
      const auto trial = fit_to_all(next);
      if (trial && searched.effect != nullptr) {
        const double gained = incumbent_.log_likelihood_ratio(*trial) -
                              bic_penalty({searched.effect}, incumbent_.residuals().samples());
        tried.push_back({searched.effect, gained, std::move(next), incumbent_.pasts()});
      } else if (trial && incumbent_.log_likelihood_ratio(*trial) >= least_gain &&
                 trial->share_held_out.value_or(0) >= 0) {
        out_.searched = true;
        incumbent_.settle_at(std::move(next));
        stand_as_base();
        before = incumbent_.pasts();
      }
      if (task_.set_pasts) task_.set_pasts(before);
    }
    if (tried.empty()) return;
    auto rivals = probabilities(tried);
    const auto best = std::ranges::max_element(tried, {}, &TriedEffect::gained);
    if (task_.set_pasts) task_.set_pasts(best->pasts);
    if (!accept(std::move(best->place), best->effect)) {
      if (task_.set_pasts) task_.set_pasts(before);
      return;
    }
    std::erase(remaining, best->effect);
    out_.searched = true;
    const auto& added = out_.added.back();
    out_.named = !added.empirical && takes_material_share(added);
    if (out_.named) out_.rivals = std::move(rivals);
  }

  // From where a search ended, to all training recordings, under the pasts that are likeliest for it. Empty
  // where the model cannot be simulated in one of them: the search saw some.
  std::optional<Comparison> fit_to_all(HypothesisPoint& at) const {
    try {
      for (int i = 0; i < rounds_of_pasts; ++i) {
        if (!incumbent_.choose_pasts(at) && i > 0) break;
        at = incumbent_.fitted(std::move(at), incumbent_.solver(8, "fitting what the search found"));
      }
      return incumbent_.weigh(at);
    } catch (const Error& failure) {
      if (failure.code() != ErrorCode::numerical) throw;
      return std::nullopt;
    }
  }

  // Where a search ended, with the instruments as they stand.
  HypothesisPoint place_of(const SearchedBase& searched) const {
    auto base = searched.model;
    std::vector<double> values;
    if (searched.effect != nullptr) {
      for (const auto& [name, value] : base.effects.back().parameters) values.push_back(value);
      base.effects.pop_back();
    }
    HypothesisPoint out{base_hypothesis(base, *task_.bench), {}};
    out.z = prior_mean(out.hypothesis);
    trust_instruments(out.hypothesis, out.z);
    widen_priors(out.hypothesis, out.z);
    out.hypothesis.reach = incumbent_.at().hypothesis.reach;
    if (searched.effect != nullptr) out.hypothesis = with_effect(out.hypothesis, *searched.effect, values);
    out.z = prior_mean(out.hypothesis);
    return out;
  }

  void add_tables() {
    demanded_ = least_share_of_table;
    demanded_held_out_ = incumbent_.noise_is_only_error() ? least_share_of_table : 0;
    auto ports = task_.tables;
    while (incumbent_.is_material() && add_empirical(ports)) {
    }
  }

  // `of_round`: share of a round of effects that is done.
  void tick(const std::string& stage, double of_round = 0) const {
    const double ports = 2 * static_cast<double>(task_.tables.size());  // mostly tried twice each
    const double done = tables_tried_ > 0
                            ? share_of_effects + (1 - share_of_effects) * std::min(1.0, tables_tried_ / ports)
                            : share_of_effects * (1 - rounds_left_ * (1 - share_of_round * of_round));
    task_.tick(stage, searched_ + (1 - searched_) * done);
  }
  // The effects that promise most, each fitted beside the incumbent.
  std::vector<TriedEffect> fitted_effects(const std::vector<const Effect*>& remaining) {
    const auto& [hypothesis, z] = incumbent_.at();
    const auto screened = screen(incumbent_.residuals(), incumbent_.fit(),
                                 {.effects = remaining, .rounds = 4, .tick = [this](double f) {
                                    tick("trying every effect on what is left", f);
                                  }});
    rounds_left_ *= 1 - share_of_round;
    std::vector<TriedEffect> out;
    for (const auto& s : screened) {
      if (out.size() == refits || s.values.empty() || s.drop < least_gain) break;
      const auto with = with_effect(hypothesis, *s.effect, s.values);
      auto f = minimize(incumbent_.residuals(), with, carried_over(with, hypothesis, z),
                        incumbent_.solver(8, "refitting " + std::string(s.effect->id)), &incumbent_.fit());
      const double gained = incumbent_.log_likelihood_ratio(f) - penalty(*s.effect);
      if (gained >= least_gain) out.push_back({s.effect, gained, {std::move(f.hypothesis), std::move(f.z)}});
    }
    std::ranges::stable_sort(out, std::greater<>(), &TriedEffect::gained);
    return out;
  }

  // Adds the effect that makes the model likeliest, if it takes the demanded share. If it does not, every
  // effect that takes half of that share is fitted to its end, with the model error estimated again: if the
  // error is as large as what an effect explains, its fit stops short, and an effect that slightly improves a
  // channel of small error is likelier. If still none takes the demanded share and no effect was added
  // before, one with which the model is no longer wrong by much is added without a name, for noise to judge.
  // Only the training recordings count for it: a second effect may be all that shows in the held-out ones.
  bool name_effect(std::vector<const Effect*>& remaining) {
    auto tried = fitted_effects(remaining);
    const auto name = [&](const TriedEffect& t, Comparison trial) {
      out_.rivals = probabilities(tried);
      std::erase(remaining, t.effect);
      take(t.place, *t.effect, std::move(trial));
      return true;
    };
    const bool noise_may_judge = task_.until_noise_may_judge && out_.added.empty();
    const TriedEffect *best = nullptr, *for_noise = nullptr;
    Comparison most, most_for_noise;
    most_for_noise.share = least_share_of_effect;
    for (auto& t : tried) {
      auto trial = incumbent_.weigh(t.place, *t.effect);
      if (!trial) continue;
      if (&t == &tried.front() && is_enough(trial)) return name(t, *std::move(trial));
      if (trial->smaller_share() >= least_part_at_first * demanded_) {
        t.place = incumbent_.fitted_beside_its_own_error(t.place);
        trial = incumbent_.weigh(t.place, *t.effect);
        if (!trial) continue;
        t.gained = incumbent_.log_likelihood_ratio(*trial) - penalty(*t.effect);
        if (trial->smaller_share() > most.smaller_share()) {
          most = *trial;
          best = &t;
        }
      }
      if (noise_may_judge && trial->share > most_for_noise.share && !incumbent_.is_gross(t.place)) {
        most_for_noise = *std::move(trial);
        for_noise = &t;
      }
    }
    if (best != nullptr && most.smaller_share() >= demanded_) return name(*best, std::move(most));
    return for_noise != nullptr && name(*for_noise, std::move(most_for_noise));
  }

  // The effect that makes the model likeliest of those that take what is demanded.
  bool add_effect(std::vector<const Effect*>& remaining) {
    auto tried = fitted_effects(remaining);
    for (auto& t : tried) {
      std::erase(remaining, t.effect);
      if (accept(std::move(t.place), t.effect)) return true;
    }
    return false;
  }

  double penalty(const Effect& e) const { return bic_penalty({&e}, incumbent_.residuals().samples()); }

  // The term at the port where the model becomes likeliest, if it holds on the held-out recordings. Only
  // terms that promise more than the best of those that are fitted are fitted as well.
  bool add_empirical(std::vector<const Effect*>& ports) {
    std::vector<LinearizedTerm> linearized;
    for (const auto* term : ports) {
      ++tables_tried_;
      tick("looking at " + std::string(term->id));
      const auto held = held_numbers(*term, incumbent_.fit().hypothesis.model, *task_.bench, task_.train,
                                     incumbent_.noise());
      if (held.front() > 0)
        linearized.push_back(
            linearize_term(*term, incumbent_.residuals(), incumbent_.fit(), held, likelihood_));
    }
    std::ranges::stable_sort(linearized, {}, &LinearizedTerm::evidence);
    std::vector<TriedTerm> tried;
    while (true) {
      const auto best = std::ranges::max_element(tried, {}, &TriedTerm::evidence);
      const double found = best == tried.end() ? least_gain : std::max(least_gain, best->evidence);
      if (!linearized.empty() && linearized.back().evidence > found) {
        const auto next = std::move(linearized.back());
        linearized.pop_back();
        tried.push_back(fit_empirical(incumbent_.residuals(), incumbent_.fit(), next, likelihood_,
                                      incumbent_.solver(6, "fitting " + std::string(next.term->id))));
        continue;
      }
      if (best == tried.end() || best->evidence < least_gain) return false;
      std::erase(ports, best->term);
      if (accept({std::move(best->fit.hypothesis), std::move(best->fit.z)}, best->term)) return true;
      tried.erase(best);
    }
  }

  bool is_enough(const std::optional<Comparison>& trial) const {
    return trial && trial->share >= demanded_ &&
           trial->share_held_out.value_or(demanded_held_out_) >= demanded_held_out_;
  }

  // Whether it takes away what is demanded on both sides; then it is taken.
  bool accept(HypothesisPoint next, const Effect* effect) {
    auto trial = incumbent_.weigh(next);
    // A table remembers turning points, so that a past shows which the model before it did not feel.
    const bool past_is_known = task_.presumed_past && switches(incumbent_.at().hypothesis.model);
    if (!is_enough(trial) && effect->table && !past_is_known) {
      const auto before = incumbent_.pasts();
      if (incumbent_.choose_pasts(next)) trial = incumbent_.weigh(next);
      if (!is_enough(trial) && task_.set_pasts) task_.set_pasts(before);
    }
    if (!is_enough(trial)) return false;
    take(std::move(next), *effect, *std::move(trial));
    return true;
  }

  void take(HypothesisPoint next, const Effect& effect, Comparison trial) {
    out_.added.push_back({.term = {.id = std::string(effect.id), .parameters = {}},
                          .empirical = effect.empirical,
                          .share = std::max(0.0, trial.share),
                          .channel = trial.channel});
    if (trial.share_held_out) out_.added.back().share_held_out = std::max(0.0, *trial.share_held_out);
    incumbent_.accept(std::move(next), std::move(trial));
  }

  const ImprovementTask& task_;
  Incumbent incumbent_;
  const LogLikelihoodRatio likelihood_ = [this](const Fit& with) {
    return incumbent_.log_likelihood_ratio(with);
  };
  double searched_ = 0;     // share of the time that the search took
  double rounds_left_ = 1;  // share of the progress of effects that is left for more rounds
  int tables_tried_ = 0;
  double demanded_ = 1, demanded_held_out_ = 1;  // shares that a term has to take away, on either side
  Improvement out_;
};

}  // namespace

std::optional<Improvement> improve(const Fit& base, const ImprovementTask& task,
                                   std::vector<std::string>& warnings) {
  try {
    return Improver(task, base).run();
  } catch (const Error& failure) {
    if (failure.code() != ErrorCode::numerical) throw;
    warnings.push_back(std::string("What is left was not narrowed: ") + failure.what() + ".");
    return std::nullopt;
  }
}

}  // namespace ferrobench::model::inference

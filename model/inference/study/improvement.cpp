#include "model/inference/study/improvement.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <numeric>
#include <tuple>
#include <utility>

#include "model/inference/parameters/parameters.h"
#include "model/inference/selection/screening.h"
#include "model/inference/selection/verdict.h"
#include "model/inference/solver/covariance.h"
#include "model/inference/solver/multifidelity.h"
#include "model/inference/study/empirical_term.h"
#include "model/inference/study/model_error.h"
#include "model/inference/study/workflow.h"

namespace ferrobench::model::inference {
namespace {

// Twice the logarithm of the odds that a term must earn beyond its numbers: 150 to 1.
constexpr double least_gain = 10;
// Shares of the excess that a term has to take away where nothing is named. A mechanism that does less is no
// better than a table, and moves parameters that it has nothing to do with; a table has to hold.
constexpr double least_share_of_effect = 0.15, least_share_of_table = 0.02;
constexpr std::size_t most_named = 2, most_effects = 6, refits = 4;
// Of the time, where a search of the base's whole range is made, and of the rest for effects: about so much.
constexpr double share_of_search = 0.7, share_of_effects = 0.3;
// Rounds in which fit and error are made to agree with each other; both move little after two.
constexpr int settling_rounds = 2;

struct Place {
  Hypothesis hypothesis;
  Eigen::VectorXd z;
};

// An effect beside the base, fitted.
struct TriedEffect {
  const Effect* effect = nullptr;
  double gained = 0;  // 2 ln of the likelihood ratio, less what its numbers cost
  Place place;
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
  explicit Improver(const ImprovementTask& task) : task_(task), noise_(*task.noise) {}

  Improvement run(const Fit& base) {
    fit_ = base;
    Place at{base.hypothesis, base.z};
    at.hypothesis.reach = 1;
    for (int i = 0; i < (by_noise() ? 1 : settling_rounds); ++i) settle(at);
    if (!task_.presumed_past)
      for (int i = 0; i < settling_rounds && other_pasts(at); ++i) settle(at);
    out_.base = fit_;
    out_.added = task_.named;
    if (out_.added.empty() && !by_noise()) name(at);
    out_.named = !out_.added.empty();
    if (!out_.named)
      narrow(at);
    else if (material_)
      fit_without_instruments(at);
    add_tables(at);
    if (!task_.presumed_past && !out_.named && !out_.added.empty() && other_pasts(at)) settle(at);
    estimate_terms(fit_, at.hypothesis, at.z, out_.added);
    out_.hypothesis = std::move(at.hypothesis);
    out_.z = std::move(at.z);
    return std::move(out_);
  }

 private:
  // What a term takes away, on recordings that were learned from and on those that were locked.
  struct Trial {
    Signals learned, locked;
    double share = 0, share_held_out = 0;
    double least() const { return std::min(share, share_held_out); }
  };

  bool by_noise() const { return task_.by_noise != nullptr; }
  const WhitenedRecordings& residuals() const { return by_noise() ? *task_.by_noise : *residuals_; }

  void name(Place& at) {
    auto remaining = task_.candidates;
    demanded_ = task_.selection.material_share;
    while (out_.added.size() < most_named && material_ && add_effect(at, remaining)) {
    }
  }

  void fit_without_instruments(Place& at) {
    trust_instruments(at.hypothesis, at.z);
    for (int i = 0; i < settling_rounds; ++i) settle(at);
  }

  void narrow(Place& at) {
    if (!by_noise()) fit_without_instruments(at);
    out_.base = fit_;
    auto remaining = task_.candidates;
    demanded_ = least_share_of_effect;
    if (!by_noise()) search_again(at, remaining);
    while (!out_.named && out_.added.size() < most_effects && material_ && add_effect(at, remaining)) {
    }
  }

  // From the whole range of the base's parameters. A better base alone takes its place; an effect beside it
  // is named if it takes as much as one that is found otherwise.
  void search_again(Place& at, std::vector<const Effect*>& remaining) {
    if (!task_.search_bases || !material_) return;
    const auto found = task_.search_bases(
        setting_at(at.hypothesis, at.z).model, noise_,
        [&](const std::string& stage, double f) { task_.tick(stage, share_of_search * f); });
    if (!found.empty()) searched_ = share_of_search;
    std::vector<TriedEffect> tried;
    auto before = pasts();
    for (const auto& searched : found) {
      Place next = place_of(searched, at);
      const auto trial = fit_to_all(next);
      if (trial && searched.effect != nullptr) {
        const double gained =
            log_likelihood_ratio_beside_error(noise_, learned_, trial->learned, task_.train) -
            bic_penalty({searched.effect}, residuals().samples());
        tried.push_back({searched.effect, gained, std::move(next), pasts()});
      } else if (trial && trial->least() >= demanded_) {
        out_.searched = true;
        at = std::move(next);
        for (int i = 0; i < settling_rounds; ++i) settle(at);
        out_.base = fit_;
        before = pasts();
      }
      if (task_.set_pasts) task_.set_pasts(before);
    }
    if (tried.empty()) return;
    auto rivals = probabilities(tried);
    const auto best = std::ranges::max_element(tried, {}, &TriedEffect::gained);
    if (task_.set_pasts) task_.set_pasts(best->pasts);
    if (!accept(at, std::move(best->place), best->effect)) {
      if (task_.set_pasts) task_.set_pasts(before);
      return;
    }
    std::erase(remaining, best->effect);
    out_.searched = true;
    const auto& added = out_.added.back();
    out_.named = std::min(*added.share, added.share_held_out.value_or(1)) >= task_.selection.material_share;
    if (out_.named) out_.rivals = std::move(rivals);
  }

  // From where a search ended, to all recordings that are learned from, under the pasts that are likeliest
  // for it. Empty where the model cannot be simulated in one of them: the search saw some.
  std::optional<Trial> fit_to_all(Place& at) const {
    try {
      for (int i = 0; i < settling_rounds; ++i) {
        if (!other_pasts(at) && i > 0) break;
        at.z = minimize(residuals(), at.hypothesis, at.z, solver(8, "fitting what the search found")).z;
      }
      return weigh(at);
    } catch (const Error& failure) {
      if (failure.code() != ErrorCode::numerical) throw;
      return std::nullopt;
    }
  }

  // Where a search ended, with the instruments as they stand.
  Place place_of(const SearchedBase& searched, const Place& at) const {
    auto base = searched.model;
    std::vector<double> values;
    if (searched.effect != nullptr) {
      for (const auto& [name, value] : base.effects.back().parameters) values.push_back(value);
      base.effects.pop_back();
    }
    Place out{base_hypothesis(base, *task_.bench), {}};
    out.z = prior_mean(out.hypothesis);
    trust_instruments(out.hypothesis, out.z);
    out.hypothesis.reach = at.hypothesis.reach;
    if (searched.effect != nullptr) out.hypothesis = with_effect(out.hypothesis, *searched.effect, values);
    out.z = prior_mean(out.hypothesis);
    return out;
  }

  void add_tables(Place& at) {
    demanded_ = least_share_of_table;
    auto ports = task_.tables;
    while (material_ && add_empirical(at, ports)) {
    }
  }

  void tick(const std::string& stage) const {
    const double ports = 2 * static_cast<double>(task_.tables.size());  // mostly tried twice each
    const double done = tables_tried_ > 0
                            ? share_of_effects + (1 - share_of_effects) * std::min(1.0, tables_tried_ / ports)
                            : share_of_effects * static_cast<double>(out_.added.size()) / (most_effects + 1);
    task_.tick(stage, searched_ + (1 - searched_) * done);
  }
  SolverOptions solver(int iterations, const std::string& stage) const {
    return {.iterations = iterations, .enough = 0.1, .tick = [this, stage] { tick(stage); }};
  }

  std::vector<protocols::Past> pasts() const {
    std::vector<protocols::Past> out;
    for (const auto& r : *task_.bench) out.push_back(r.header.past);
    return out;
  }

  // Gives each recording the past that is likeliest where the model stands now; whether any has another one.
  // A model that is wrong by much misses its channels alike, over their ranges, and so the misses are
  // counted. An error of each channel's own would let a past be taken that meets one channel far better than
  // the model can, at the other's cost. By noise alone a past is changed only where that is likelier.
  bool other_pasts(const Place& at) const {
    if (!task_.choose_pasts) return false;
    tick("choosing the specimen's past");
    const auto stood = pasts();
    auto chosen = task_.choose_pasts(setting_at(at.hypothesis, at.z).model);
    if (by_noise()) {
      std::vector<std::size_t> all(stood.size());
      std::iota(all.begin(), all.end(), std::size_t{0});
      const auto before = miss(at, all);
      task_.set_pasts(chosen);
      const auto after = miss(at, all);
      for (const std::size_t r : all)
        if (!(log_likelihood_ratio_beside_error(noise_, {before[r]}, {after[r]}, {r}) > 0))
          chosen[r] = stood[r];
    }
    task_.set_pasts(chosen);
    return chosen != stood;
  }

  // Measured less simulated over the noise.
  Signals miss(const Place& at, const std::vector<std::size_t>& recordings) const {
    const WhitenedRecordings fine(*task_.bench, *task_.noise, recordings, simulation_, task_.threads);
    if (!by_noise()) return predict(fine, at.hypothesis, at.z).standardized;
    const WhitenedRecordings coarse(*task_.bench, *task_.noise, recordings, residuals().simulation(),
                                    task_.threads);
    return predict(fine, coarse, at.hypothesis, at.z).standardized;
  }

  void settle(Place& at) {
    tick("how wrong the model is");
    learned_ = miss(at, task_.train);
    locked_ = miss(at, task_.held_out);
    refit(at);
  }

  // The model's error by what it misses where it stands; the fit beside it, or by noise alone.
  void refit(Place& at) {
    // All together: what is usual of a channel cannot be said by the few that are locked.
    auto recordings = task_.train;
    auto missed = learned_;
    recordings.insert(recordings.end(), task_.held_out.begin(), task_.held_out.end());
    missed.insert(missed.end(), locked_.begin(), locked_.end());
    estimate_model_errors(*task_.bench, missed, recordings, noise_);
    material_ = is_error_material(*task_.bench, noise_, task_.train, task_.floor);
    if (!by_noise()) weigh_rows(at.hypothesis);
    fit_ = minimize(residuals(), at.hypothesis, at.z,
                    solver(12, by_noise() ? "refitting" : "fitting beside the model's error"),
                    by_noise() ? &fit_ : nullptr);
    refresh_jacobian(residuals(), fit_);
    at.z = fit_.z;
  }

  // The residuals beside the model's error.
  void weigh_rows(const Hypothesis& hypothesis) {
    const bool first = residuals_ == nullptr;
    residuals_ =
        std::make_unique<WhitenedRecordings>(*task_.bench, noise_, task_.train, coarse_, task_.threads);
    if (!first) return;
    WhitenedRecordings fine(*task_.bench, noise_, task_.train, simulation_, task_.threads);
    choose_fidelities(*residuals_, fine, hypothesis, simulation_.domains);
    coarse_ = residuals_->simulation();
  }

  double log_likelihood_ratio(const Fit& with) const {
    return log_likelihood_ratio_beside_error(residuals(), noise_, fit_, with);
  }

  // The effect that makes the model likeliest, if any does and holds on the locked recordings.
  bool add_effect(Place& at, std::vector<const Effect*>& remaining) {
    const auto screened =
        screen(residuals(), fit_, {.effects = remaining, .rounds = 4, .tick = [this](double) {
                                     tick("trying every effect on what is left");
                                   }});
    std::vector<TriedEffect> tried;
    for (const auto& s : screened) {
      if (tried.size() == refits || s.values.empty() || s.drop < least_gain) break;
      const auto hypothesis = with_effect(at.hypothesis, *s.effect, s.values);
      auto z = prior_mean(hypothesis);
      z.head(at.z.size()) = at.z;
      auto f =
          minimize(residuals(), hypothesis, z, solver(8, "refitting " + std::string(s.effect->id)), &fit_);
      const double gained = log_likelihood_ratio(f) - bic_penalty({s.effect}, residuals().samples());
      tried.push_back({s.effect, gained, {std::move(f.hypothesis), std::move(f.z)}});
    }
    auto rivals = probabilities(tried);
    while (!tried.empty()) {
      const auto best = std::ranges::max_element(tried, {}, &TriedEffect::gained);
      if (best->gained < least_gain) return false;
      std::erase(remaining, best->effect);
      if (accept(at, std::move(best->place), best->effect)) {
        out_.rivals = std::move(rivals);
        return true;
      }
      if (demanded_ == task_.selection.material_share) return false;
      tried.erase(best);
    }
    return false;
  }

  // The term at the port where the model becomes likeliest, if it holds on the locked recordings.
  bool add_empirical(Place& at, std::vector<const Effect*>& ports) {
    std::vector<TriedTerm> tried;
    for (const auto* term : ports) {
      ++tables_tried_;
      const auto held = held_numbers(*term, fit_.hypothesis.model, *task_.bench, task_.train, noise_);
      if (held.front() > 0)
        tried.push_back(fit_empirical(
            residuals(), fit_, *term, held, [this](const Fit& with) { return log_likelihood_ratio(with); },
            solver(6, "fitting " + std::string(term->id))));
    }
    std::ranges::stable_sort(tried, std::greater<>(), &TriedTerm::evidence);
    for (auto& t : tried) {
      if (t.evidence < least_gain) return false;
      std::erase(ports, t.term);
      if (accept(at, {std::move(t.fit.hypothesis), std::move(t.fit.z)}, t.term)) return true;
    }
    return false;
  }

  Trial weigh(const Place& next) const {
    const auto excess = [&](const Signals& missed, const std::vector<std::size_t>& recordings) {
      return by_noise() ? excess_squares(missed) : excess_beside_error(noise_, missed, recordings);
    };
    const auto share_of = [&](const Signals& before, const Signals& after, const auto& recordings) {
      return 1 - excess(after, recordings) / excess(before, recordings);
    };
    Trial out{.learned = miss(next, task_.train), .locked = miss(next, task_.held_out)};
    out.share = out.share_held_out = share_of(learned_, out.learned, task_.train);
    // What does not show in the locked recordings cannot be proved there; it must not come to show there
    // either.
    const auto& how = task_.selection;
    if (!task_.held_out.empty() && (shows(locked_, how) || shows(out.locked, how)))
      out.share_held_out = share_of(locked_, out.locked, task_.held_out);
    return out;
  }

  bool accept(Place& at, Place next, const Effect* effect) {
    auto trial = weigh(next);
    // A table remembers turning points, so that a past shows which the model before it did not feel.
    if (trial.least() < demanded_ && effect->empirical && !by_noise()) {
      const auto before = pasts();
      if (other_pasts(next)) trial = weigh(next);
      if (trial.least() < demanded_ && task_.set_pasts) task_.set_pasts(before);
    }
    if (trial.least() < demanded_) return false;
    at = std::move(next);
    out_.added.push_back({.term = {.id = std::string(effect->id), .parameters = {}},
                          .empirical = effect->empirical,
                          .share = std::max(0.0, trial.share)});
    if (!task_.held_out.empty()) out_.added.back().share_held_out = std::max(0.0, trial.share_held_out);
    learned_ = std::move(trial.learned);
    locked_ = std::move(trial.locked);
    refit(at);
    return true;
  }

  const ImprovementTask& task_;
  std::vector<std::vector<NoiseModel>> noise_;  // with the model's error
  SimulationOptions simulation_ = task_.simulation, coarse_ = task_.simulation;
  std::unique_ptr<WhitenedRecordings> residuals_;
  Fit fit_;
  Signals learned_, locked_;
  bool material_ = false;
  double searched_ = 0;  // share of the time that the search took
  int tables_tried_ = 0;
  double demanded_ = 1;  // share that a term has to take away, on both sides
  Improvement out_;
};

}  // namespace

Improvement improve(const Fit& base, const ImprovementTask& task) {
  return Improver(task).run(base);
}

}  // namespace ferrobench::model::inference

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

namespace ferrobench::model::inference {
namespace {

// Twice the logarithm of the odds that a term must earn beyond its numbers: 150 to 1.
constexpr double least_gain = 10;
// Shares of the excess that a term has to take away where nothing is named. A mechanism that does less is no
// better than a table, and moves parameters that it has nothing to do with; a table has to hold.
constexpr double least_share_of_effect = 0.15, least_share_of_table = 0.02;
constexpr std::size_t most_named = 2, most_effects = 6, refits = 4;
// Rounds in which fit and error are made to agree with each other; both move little after two.
constexpr int settling_rounds = 2;

struct Place {
  Hypothesis hypothesis;
  Eigen::VectorXd z;
};

// Of effects by twice the logarithm of their likelihoods; most probable first.
std::vector<std::pair<const Effect*, double>> probabilities(const std::vector<std::pair<double, Fit>>& tried,
                                                            const std::vector<const Effect*>& effects) {
  std::vector<std::pair<const Effect*, double>> out;
  double sum = 0, best = -std::numeric_limits<double>::infinity();
  for (const auto& t : tried) best = std::max(best, t.first);
  for (std::size_t i = 0; i < tried.size(); ++i) {
    out.emplace_back(effects[i], std::exp(0.5 * (tried[i].first - best)));
    sum += out.back().second;
  }
  for (auto& [effect, probability] : out) probability /= sum;
  std::ranges::stable_sort(out, std::greater<>(), [](const auto& r) { return r.second; });
  return out;
}

class Improver {
 public:
  explicit Improver(const ImprovementTask& task) : task_(task), noise_(*task.noise) {}

  Improvement run(const Hypothesis& base, const Eigen::VectorXd& z) {
    Place at{base, z};
    at.hypothesis.reach = 1;
    for (int i = 0; i < settling_rounds; ++i) settle(at);
    if (!task_.presumed_past)
      for (int i = 0; i < settling_rounds && other_pasts(at); ++i) settle(at);
    out_.base = fit_;
    out_.added = task_.named;
    if (out_.added.empty()) name(at);
    out_.named = !out_.added.empty();
    if (!out_.named) narrow(at);
    add_tables(at);
    if (!task_.presumed_past && !out_.named && !out_.added.empty() && other_pasts(at)) settle(at);
    tell_values(at);
    out_.hypothesis = std::move(at.hypothesis);
    out_.z = std::move(at.z);
    return std::move(out_);
  }

 private:
  void name(Place& at) {
    auto remaining = task_.candidates;
    demanded_ = task_.selection.material_share;
    while (out_.added.size() < most_named && material_ && add_effect(at, remaining)) {
    }
  }

  // The model is handed on without gains and offsets, so what is fitted to the rest must not count on them.
  void fit_without_instruments(Place& at) {
    trust_instruments(at.hypothesis, at.z);
    for (int i = 0; i < settling_rounds; ++i) settle(at);
  }

  void narrow(Place& at) {
    fit_without_instruments(at);
    out_.base = fit_;
    auto remaining = task_.candidates;
    demanded_ = least_share_of_effect;
    while (out_.added.size() < most_effects && material_ && add_effect(at, remaining)) {
    }
  }

  void add_tables(Place& at) {
    if (out_.named && material_) fit_without_instruments(at);
    demanded_ = least_share_of_table;
    auto ports = task_.tables;
    while (material_ && add_empirical(at, ports)) {
    }
  }

  void tick(const std::string& stage) const {
    const double done = static_cast<double>(out_.added.size()) / (most_effects + 1);
    task_.tick(stage, done);
  }
  SolverOptions solver(int iterations, const std::string& stage) const {
    return {.iterations = iterations, .enough = 0.1, .tick = [this, stage] { tick(stage); }};
  }

  std::vector<protocols::Past> pasts() const {
    std::vector<protocols::Past> out;
    for (const auto& r : *task_.bench) out.push_back(r.header.past);
    return out;
  }

  // Gives each recording another past if that is likelier where the model stands now; whether any has one.
  bool other_pasts(const Place& at) const {
    if (!task_.choose_pasts) return false;
    tick("choosing the specimen's past");
    auto chosen = pasts();
    std::vector<std::size_t> all(chosen.size());
    std::iota(all.begin(), all.end(), std::size_t{0});
    const auto others = task_.choose_pasts(setting_at(at.hypothesis, at.z).model);
    const auto before = miss(at, all);
    task_.set_pasts(others);
    const auto after = miss(at, all);
    bool any = false;
    for (const std::size_t r : all) {
      if (!(excess_beside_error(noise_, {after[r]}, {r}) < excess_beside_error(noise_, {before[r]}, {r})))
        continue;
      any = any || chosen[r] != others[r];
      chosen[r] = others[r];
    }
    task_.set_pasts(chosen);
    return any;
  }

  // Measured less simulated over the noise.
  Signals miss(const Place& at, const std::vector<std::size_t>& recordings) const {
    const WhitenedRecordings fine(*task_.bench, *task_.noise, recordings, simulation_, task_.threads);
    return predict(fine, at.hypothesis, at.z).standardized;
  }

  void settle(Place& at) {
    tick("how wrong the model is");
    learned_ = miss(at, task_.train);
    locked_ = miss(at, task_.held_out);
    fit_beside_error(at);
  }

  // The model's error by what it misses where it stands, the residuals under it, and the fit to these.
  void fit_beside_error(Place& at) {
    estimate_model_errors(*task_.bench, learned_, task_.train, noise_);
    estimate_model_errors(*task_.bench, locked_, task_.held_out, noise_);
    material_ = is_error_material(*task_.bench, noise_, task_.train, task_.floor);
    residuals_ =
        std::make_unique<WhitenedRecordings>(*task_.bench, noise_, task_.train, coarse_, task_.threads);
    if (!chosen_) {
      WhitenedRecordings fine(*task_.bench, noise_, task_.train, simulation_, task_.threads);
      choose_fidelities(*residuals_, fine, at.hypothesis, simulation_.domains);
      coarse_ = residuals_->simulation();
      chosen_ = true;
    }
    fit_ = minimize(*residuals_, at.hypothesis, at.z, solver(12, "fitting beside the model's error"));
    refresh_jacobian(*residuals_, fit_);
    at.z = fit_.z;
  }

  // Twice the logarithm of the likelihood ratio, each error at its own estimate: the sum over channels of
  // recordings of n ln(squares before / squares with), n their independent rows.
  double log_likelihood_ratio(const Fit& with) const {
    double out = prior_squares(fit_.hypothesis, fit_.z) - prior_squares(with.hypothesis, with.z);
    for (const auto& b : residuals_->blocks()) {
      const double n = static_cast<double>(b.count) / noise_[b.recording][b.channel].rows_as_one;
      out += n * std::log(fit_.residual.segment(b.begin, b.count).squaredNorm() /
                          with.residual.segment(b.begin, b.count).squaredNorm());
    }
    return out;
  }

  // The effect that makes the model likeliest, if any does and holds on the locked recordings.
  bool add_effect(Place& at, std::vector<const Effect*>& remaining) {
    const auto screened =
        screen(*residuals_, fit_, {.effects = remaining, .rounds = 4, .tick = [this](double) {
                                     tick("trying every effect beside the model's error");
                                   }});
    std::vector<std::pair<double, Fit>> tried;
    std::vector<const Effect*> effects;
    for (const auto& s : screened) {
      if (tried.size() == refits || s.values.empty() || s.drop < least_gain) break;
      const auto hypothesis = with_effect(at.hypothesis, *s.effect, s.values);
      auto z = prior_mean(hypothesis);
      z.head(at.z.size()) = at.z;
      auto f =
          minimize(*residuals_, hypothesis, z, solver(8, "refitting " + std::string(s.effect->id)), &fit_);
      const double gained = log_likelihood_ratio(f) - bic_penalty({s.effect}, residuals_->samples());
      tried.emplace_back(gained, std::move(f));
      effects.push_back(s.effect);
    }
    auto rivals = probabilities(tried, effects);
    while (!tried.empty()) {
      const auto best = std::ranges::max_element(tried, {}, [](const auto& t) { return t.first; });
      const auto which = best - tried.begin();
      if (best->first < least_gain) return false;
      Place next{best->second.hypothesis, best->second.z};
      const auto* effect = effects[static_cast<std::size_t>(which)];
      std::erase(remaining, effect);
      if (accept(at, std::move(next), effect)) {
        out_.rivals = std::move(rivals);
        return true;
      }
      if (demanded_ == task_.selection.material_share) return false;
      tried.erase(best);
      effects.erase(effects.begin() + which);
    }
    return false;
  }

  // 2 ln of the marginal likelihood over that without the term.
  double evidence(const Fit& with) const {
    const auto log_determinant = [](const Fit& f) {
      const Eigen::LDLT<Eigen::MatrixXd> factor(f.normal());
      return factor.vectorD().array().max(1e-300).log().sum();
    };
    return log_likelihood_ratio(with) - (log_determinant(with) - log_determinant(fit_));
  }

  struct Tried {
    const Effect* term = nullptr;
    Fit fit;
    double evidence = -std::numeric_limits<double>::infinity();
  };

  // The term at one port: the time constant by a grid, then the width of the weights by the fixed point of
  // the marginal likelihood (D. J. C. MacKay, Neural Comput. 4 (1992) 415).
  Tried fit_empirical(const Place& at, const Effect& term) const {
    Tried best{.term = &term, .fit = {}};
    const double amplitude = term_amplitude(term, fit_.hypothesis.model, *task_.bench, task_.train, noise_);
    if (amplitude <= 0) return best;
    const bool remembers = term.parameters[2].unit == "s";
    const auto solve = [&](const std::vector<double>& fixed, double width, const Eigen::VectorXd& from) {
      const auto hypothesis = with_empirical(at.hypothesis, term, fixed, width);
      Eigen::VectorXd z = prior_mean(hypothesis);
      z.head(from.size()) = from;
      auto f = minimize(*residuals_, hypothesis, z, solver(6, "fitting " + std::string(term.id)), &fit_);
      if (!f.fresh) refresh_jacobian(*residuals_, f);
      return f;
    };
    const auto keep = [&](Fit f) {
      const double e = evidence(f);
      if (e <= best.evidence) return false;
      best.fit = std::move(f);
      best.evidence = e;
      return true;
    };
    std::vector<double> fixed{amplitude, largest_field(*task_.bench)};
    const auto [shortest, longest] = residuals_->times();
    if (remembers) {
      fixed.push_back(0);
      double kept = 0;
      for (const double decades : {0.25, 0.5, 0.75}) {
        fixed.back() = 10 * shortest * std::pow(longest / (10 * shortest), decades);
        if (keep(solve(fixed, 1, at.z))) kept = fixed.back();
      }
      fixed.back() = kept;
    } else {
      keep(solve(fixed, 1, at.z));
    }
    if (!std::isfinite(best.evidence)) return best;
    double width = 1;
    for (int i = 0; i < width_rounds; ++i) {
      const auto weights = best.fit.z.tail(best.fit.z.size() - at.z.size());
      const Eigen::MatrixXd covariance = best.fit.normal().inverse();
      const double undetermined = covariance.diagonal().tail(weights.size()).sum(),
                   determined = static_cast<double>(weights.size()) - undetermined;
      width *= std::clamp(std::sqrt(weights.squaredNorm() / std::max(0.1, determined)), 0.1, 10.0);
      if (!keep(solve(fixed, width, best.fit.z.head(at.z.size())))) break;
    }
    return best;
  }

  // The term at the port where the model becomes likeliest, if it holds on the locked recordings.
  bool add_empirical(Place& at, std::vector<const Effect*>& ports) {
    std::vector<Tried> tried;
    tried.reserve(ports.size());
    for (const auto* term : ports) tried.push_back(fit_empirical(at, *term));
    std::ranges::stable_sort(tried, std::greater<>(), &Tried::evidence);
    for (auto& t : tried) {
      if (t.evidence < least_gain) return false;
      std::erase(ports, t.term);
      if (accept(at, {std::move(t.fit.hypothesis), std::move(t.fit.z)}, t.term)) return true;
    }
    return false;
  }

  // What a term takes away, on recordings that were learned from and on those that were locked.
  struct Trial {
    Signals learned, locked;
    double share = 0, share_held_out = 0;
    double least() const { return std::min(share, share_held_out); }
  };

  Trial weigh(const Place& next) const {
    const auto share_of = [&](const Signals& before, const Signals& after,
                              const std::vector<std::size_t>& recordings) {
      return 1 -
             excess_beside_error(noise_, after, recordings) / excess_beside_error(noise_, before, recordings);
    };
    Trial out{.learned = miss(next, task_.train), .locked = miss(next, task_.held_out)};
    out.share = out.share_held_out = share_of(learned_, out.learned, task_.train);
    // What does not show in the locked recordings cannot be proved there; it must not come to show there
    // either.
    const auto shows = [&](const Signals& standardized) {
      return mean_square(standardized) > 1 + task_.selection.lack_of_fit;
    };
    if (!task_.held_out.empty() && (shows(locked_) || shows(out.locked)))
      out.share_held_out = share_of(locked_, out.locked, task_.held_out);
    return out;
  }

  bool accept(Place& at, Place next, const Effect* effect) {
    auto trial = weigh(next);
    // A table remembers turning points, so that a past shows which the model before it did not feel.
    if (trial.least() < demanded_ && effect->empirical) {
      const auto before = pasts();
      if (other_pasts(next)) trial = weigh(next);
      if (trial.least() < demanded_ && task_.set_pasts) task_.set_pasts(before);
    }
    if (trial.least() < demanded_) return false;
    at = std::move(next);
    out_.added.push_back({.term = {.id = std::string(effect->id), .parameters = {}},
                          .empirical = effect->empirical,
                          .share = std::max(0.0, trial.share),
                          .share_held_out = task_.held_out.empty()
                                                ? std::nullopt
                                                : std::optional(std::max(0.0, trial.share_held_out))});
    learned_ = std::move(trial.learned);
    locked_ = std::move(trial.locked);
    fit_beside_error(at);
    return true;
  }

  // Values of the added terms with 90 % intervals; what was held fixed has none.
  void tell_values(const Place& at) {
    const Eigen::MatrixXd covariance = fit_.normal().inverse();
    const auto& moved = at.hypothesis.parameters;
    for (auto& added : out_.added) {
      const auto& effect = find_effect(added.term.id);
      added.term.parameters.clear();
      for (const auto& p : effect.parameters) {
        const auto path = "effects." + added.term.id + "." + std::string(p.name);
        const double value = get_parameter(setting_at(at.hypothesis, at.z).model, path);
        EffectEstimate::Parameter told{std::string(p.name), value, value, value};
        const auto c = std::ranges::find(moved, path, &ScaledParameter::path);
        if (c != moved.end()) {
          const auto k = static_cast<Eigen::Index>(c - moved.begin());
          const double reach = interval_90 * std::sqrt(std::max(0.0, covariance(k, k)));
          std::tie(told.low, told.high) = std::minmax<double>(
              {c->value(std::max(c->low, at.z[k] - reach)), c->value(std::min(c->high, at.z[k] + reach))});
        }
        added.term.parameters.push_back(std::move(told));
      }
    }
  }

  static constexpr int width_rounds = 3;

  const ImprovementTask& task_;
  std::vector<std::vector<NoiseModel>> noise_;  // with the model's error
  SimulationOptions simulation_ = task_.simulation, coarse_ = task_.simulation;
  bool chosen_ = false;
  std::unique_ptr<WhitenedRecordings> residuals_;
  Fit fit_;
  Signals learned_, locked_;
  bool material_ = false;
  double demanded_ = 1;  // share that a term has to take away, on both sides
  Improvement out_;
};

}  // namespace

Improvement improve(const Hypothesis& base, const Eigen::VectorXd& z, const ImprovementTask& task) {
  return Improver(task).run(base, z);
}

}  // namespace ferrobench::model::inference

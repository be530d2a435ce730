#include "model/inference/study/improvement.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <utility>

#include "model/inference/selection/screening.h"
#include "model/inference/solver/covariance.h"
#include "model/inference/solver/multifidelity.h"

namespace ferrobench::model::inference {
namespace {

// Twice the logarithm of the odds that a term must earn beyond its numbers: 150 to 1.
constexpr double least_gain = 10;
// Of the locked recordings' excess a term has to take away at least this much, or it does not hold there.
constexpr double least_share_held_out = 0.01;
constexpr std::size_t most_effects = 6, refits = 4;
// Rounds in which fit and error are made to agree with each other; both move little after two.
constexpr int settling_rounds = 2;

struct Place {
  Hypothesis hypothesis;
  Eigen::VectorXd z;
};

class Improver {
 public:
  Improver(const ImprovementTask& task) : task_(task), noise_(*task.noise) {}

  Improvement run(const Hypothesis& base, const Eigen::VectorXd& z) {
    Place at{base, z};
    at.hypothesis.reach = 1;
    for (int i = 0; i < settling_rounds; ++i) settle(at);
    auto remaining = task_.candidates;
    while (out_.added.size() < most_effects && material_ && add_effect(at, remaining)) {
    }
    out_.covariance = fit_.normal().inverse();
    out_.hypothesis = std::move(at.hypothesis);
    out_.z = std::move(at.z);
    return std::move(out_);
  }

 private:
  void tick(const std::string& stage) const {
    const double done = static_cast<double>(out_.added.size()) / (most_effects + 1);
    task_.tick(stage, done);
  }
  SolverOptions solver(int iterations, const std::string& stage) const {
    return {.iterations = iterations, .enough = 0.1, .tick = [this, stage] { tick(stage); }};
  }

  // Measured less simulated over the noise.
  Signals miss(const Place& at, const std::vector<std::size_t>& recordings) const {
    const WhitenedRecordings fine(*task_.bench, *task_.noise, recordings, simulation_, task_.threads);
    Signals out;
    for (const std::size_t r : recordings) {
      const auto simulated = fine.simulated(at.hypothesis, at.z, r);
      auto& of = out.emplace_back();
      for (std::size_t c = 0; c < simulated.size(); ++c) of.push_back(fine.plain_residual(r, c, simulated[c]));
    }
    return out;
  }

  // The model's error where it stands, the residuals under it, and the fit to these.
  void settle(Place& at) {
    tick("how wrong the model is");
    learned_ = miss(at, task_.train);
    locked_ = miss(at, task_.held_out);
    const WhitenedRecordings plain(*task_.bench, *task_.noise, task_.train, simulation_, task_.threads);
    const auto left = left_by_channel(plain, learned_);
    material_ = std::ranges::any_of(left, [&](const auto& l) { return l.second.model_error > task_.floor; });
    for (std::size_t i = 0; i < task_.train.size(); ++i) {
      const std::size_t r = task_.train[i];
      for (std::size_t c = 0; c < learned_[i].size(); ++c) {
        auto& n = noise_[r][c];
        const auto& m = (*task_.bench)[r].channels[c];
        n.model_error = std::max(left.at(m.channel).model_error, least_error) * m.range;
        std::vector<double> rows;
        for (const double e : learned_[i][c])
          if (!std::isnan(e)) rows.push_back(e);
        n.rows_as_one = std::max(
            1.0, correlated_rows(Eigen::Map<const Eigen::VectorXd>(rows.data(), std::ssize(rows))));
      }
    }
    residuals_ = std::make_unique<WhitenedRecordings>(*task_.bench, noise_, task_.train,
                                                      SimulationOptions{.tolerance = 1e-4, .domains = 1000},
                                                      task_.threads);
    residuals_->simulate_by(coarse_);
    fit_ = minimize(*residuals_, at.hypothesis, at.z, solver(12, "fitting beside the model's error"));
    refresh_jacobian(*residuals_, fit_);
    at.z = fit_.z;
  }

  double gain(const Fit& with, double numbers) const {
    const double n = residuals_->samples();
    return n * std::log(fit_.squares / with.squares) - numbers * std::log(n);
  }

  // The effect that makes the model likeliest, if any does and holds on the locked recordings.
  bool add_effect(Place& at, std::vector<const Effect*>& remaining) {
    const auto screened = screen(*residuals_, fit_, {.effects = remaining, .rounds = 4, .tick = [this](double) {
                                                       tick("trying every effect beside the model's error");
                                                     }});
    std::vector<std::pair<double, Fit>> tried;
    std::vector<const Effect*> effects;
    for (const auto& s : screened) {
      if (tried.size() == refits || s.values.empty() || s.drop < least_gain) break;
      const auto hypothesis = with_effect(at.hypothesis, *s.effect, s.values);
      auto z = prior_mean(hypothesis);
      z.head(at.z.size()) = at.z;
      auto f = minimize(*residuals_, hypothesis, z, solver(8, "refitting " + std::string(s.effect->id)), &fit_);
      const double gained = gain(f, static_cast<double>(s.effect->parameters.size()));
      tried.emplace_back(gained, std::move(f));
      effects.push_back(s.effect);
    }
    while (!tried.empty()) {
      const auto best = std::ranges::max_element(tried, {}, [](const auto& t) { return t.first; });
      const auto which = best - tried.begin();
      if (best->first < least_gain) return false;
      Place next{best->second.hypothesis, best->second.z};
      const auto* effect = effects[static_cast<std::size_t>(which)];
      std::erase(remaining, effect);
      if (accept(at, std::move(next), effect)) return true;
      tried.erase(best);
      effects.erase(effects.begin() + which);
    }
    return false;
  }

  bool accept(Place& at, Place next, const Effect* effect) {
    const double share = share_explained(learned_, miss(next, task_.train)),
                 held = task_.held_out.empty() ? share
                                               : share_explained(locked_, miss(next, task_.held_out));
    if (held < least_share_held_out) return false;
    at = std::move(next);
    out_.added.push_back({effect, share, held});
    settle(at);
    return true;
  }

  static constexpr double least_error = 1e-5;  // of the range: the likelihood needs one above zero

  const ImprovementTask& task_;
  std::vector<std::vector<NoiseModel>> noise_;  // with the model's error
  SimulationOptions simulation_ = task_.simulation, coarse_{.tolerance = 1e-4, .domains = 1000};
  std::unique_ptr<WhitenedRecordings> residuals_;
  Fit fit_;
  Signals learned_, locked_;
  bool material_ = false;
  Improvement out_;
};

}  // namespace

Improvement improve(const Hypothesis& base, const Eigen::VectorXd& z, const ImprovementTask& task) {
  return Improver(task).run(base, z);
}

}  // namespace ferrobench::model::inference

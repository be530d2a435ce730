// The model that stands while a gap is narrowed (improvement.h): its fit, its own error beside the noise, and
// what it misses of the training and of the held-out recordings. What is tried is weighed against it and, if
// it is better, takes its place.
#pragma once

#include <algorithm>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "model/inference/study/improvement.h"

namespace ferrobench::model::inference {

struct HypothesisPoint {
  Hypothesis hypothesis;
  Eigen::VectorXd z;
};

// What a trial misses, and the share of the incumbent's excess that it takes away: on the training and on the
// held-out recordings.
struct Comparison {
  Signals training, held_out;
  double share = 0;
  std::optional<double> share_held_out{};        // empty: these recordings say nothing about the trial
  std::optional<recordings::Channel> channel{};  // the one whose excess is meant; empty: that of all
  double smaller_share() const { return std::min(share, share_held_out.value_or(share)); }
};

class Incumbent {
 public:
  using Tick = std::function<void(const std::string& stage)>;
  Incumbent(const ImprovementTask& task, const Fit& base, Tick tick);

  const HypothesisPoint& at() const { return at_; }
  const Fit& fit() const { return fit_; }
  // Noise and model error of each channel of each recording.
  const std::vector<std::vector<NoiseModel>>& noise() const { return noise_; }
  // Whether its error is worth working on in any training recording.
  bool is_material() const { return material_; }
  // Whether noise is the only error of the likelihood; else the model has an error of its own beside it.
  bool noise_is_only_error() const { return task_.noise_only != nullptr; }
  // Weighed by noise and error, by the simulation that fits are made by.
  const WhitenedRecordings& residuals() const {
    return noise_is_only_error() ? *task_.noise_only : *residuals_;
  }
  SolverOptions solver(int iterations, const std::string& stage) const;

  // 2 ln of the likelihood ratio over the incumbent.
  double log_likelihood_ratio(const Fit& with) const;
  double log_likelihood_ratio(const Comparison& with) const;
  // Compares a model with the incumbent by the fine simulation. Empty if that fails for one of the
  // recordings; it may fail where the coarse simulation of the fits did not.
  std::optional<Comparison> weigh(const HypothesisPoint& next) const;
  // The same of an effect that `next` has beside the incumbent. One of a sensor is weighed in that sensor's
  // channel (sensor_channel.h), if it does not make the others worse.
  std::optional<Comparison> weigh(const HypothesisPoint& next, const Effect& effect) const;

  // Fits a model that need not be near the incumbent, beside the model's error.
  HypothesisPoint fitted(HypothesisPoint at, const SolverOptions& options) const;
  // Fits a trial to its end with the model error that the trial itself leaves, not that of the incumbent.
  HypothesisPoint fitted_beside_its_own_error(HypothesisPoint trial) const;
  // Whether a model is wrong by much there.
  bool is_gross(const HypothesisPoint& at) const;

  // Estimates the model error and refits, in turn; both change little after two rounds.
  void settle(int rounds = 2);
  void settle_at(HypothesisPoint next);
  void settle_with_trusted_instruments();
  // And with the base's numbers as little known as those of a model that is wrong by much.
  void settle_with_free_base();
  // Makes `next` the incumbent and refits all of its parameters. The refit is dropped if it raises the excess
  // of the training or of the held-out recordings by more than the share `most_lost`.
  void accept(HypothesisPoint next, Comparison trial);
  // Chooses the likeliest pasts. They are kept if less is missed of the training recordings, and of the
  // held-out ones no more than `most_lost`. Beside them all is refitted, and the refit kept as after a term.
  void refit_under_other_pasts();

  std::vector<protocols::Past> pasts() const;
  // Gives each recording its likeliest past under this model. Returns whether any past changed.
  bool choose_pasts(const HypothesisPoint& at) const;

 private:
  Signals miss(const HypothesisPoint& at, const std::vector<std::size_t>& recordings) const;
  double amount_of(const Signals& missed, const std::vector<std::size_t>& recordings) const;
  double action_on_held_out(const HypothesisPoint& next, const Effect& effect, const Comparison& trial) const;
  Comparison in_its_channel(Comparison trial, const HypothesisPoint& next, const Effect& effect) const;
  void estimate_errors(Signals training, const Signals& held_out,
                       std::vector<std::vector<NoiseModel>>& errors) const;
  void look();
  void stand(HypothesisPoint at, Signals training, Signals held_out);
  HypothesisPoint fitted_beside(const std::vector<std::vector<NoiseModel>>& errors, HypothesisPoint at,
                                const SolverOptions& options) const;
  Fit refitted() const;
  bool refit();
  void move(Fit to);
  Eigen::VectorXd weigh_rows();

  const ImprovementTask& task_;
  Tick tick_;
  std::vector<std::vector<NoiseModel>> noise_;
  SimulationOptions simulation_ = task_.simulation;
  std::unique_ptr<WhitenedRecordings> residuals_, fine_;  // beside the model's error; null by noise alone
  HypothesisPoint at_;
  Fit fit_;
  Signals training_, held_out_;
  bool material_ = false;
};

}  // namespace ferrobench::model::inference

#include "model/inference/study/incumbent.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "model/inference/selection/verdict.h"
#include "model/inference/solver/multifidelity.h"
#include "model/inference/study/empirical_term.h"
#include "model/inference/study/model_error.h"
#include "model/inference/study/sensor_channel.h"
#include "model/inference/study/unknown_pasts.h"

namespace ferrobench::model::inference {
namespace {

// A refit may cost either side this share of its excess, as much as a term has to take away at least. Without
// that bound the refit after a table took the charge of a held-out loop of the ceramic from 1.2 to 3.9 % of
// its range.
constexpr double most_lost = 0.02;
// The share of its channel's excess that a sensor's effect may add on held-out recordings in which it is too
// small to show. The base's parameters were fitted beside it, and that moves what is missed there: a lag of
// the displacement that took 0.998 of the excess of fast loops, whose physics was not the model's, added 0.07
// to that of slow ones.
constexpr double most_lost_beside_sensor = 0.15;
// Rounds in which an error and a fit beside it follow each other down, while one gains this in 2 ln of the
// likelihood. Of a leakage that left 28 times the noise, a round halved what was left.
constexpr int most_rounds_of_error = 8;
constexpr double least_gain_of_round = 10;

// From the cheapest ones on: what a place far away asked for can be many times too much. Returns the fine
// one's residuals there.
Eigen::VectorXd choose_simulations(WhitenedRecordings& coarse, WhitenedRecordings& fine,
                                   const HypothesisPoint& at, int most_domains) {
  auto simulation = fine.simulation();
  simulation.domains = std::min(most_domains, least_fine_domains);
  fine.simulate_by(simulation);
  return choose_fidelities(coarse, fine, at.hypothesis, at.z, most_domains, beside_model_error).residual;
}

}  // namespace

Incumbent::Incumbent(const ImprovementTask& task, const Fit& base, Tick tick)
    : task_(task), tick_(std::move(tick)), noise_(*task.noise), at_{base.hypothesis, base.z}, fit_(base) {
  at_.hypothesis.reach = 1;
  if (!noise_is_only_error()) simulation_.domains = std::min(simulation_.domains, least_fine_domains);
}

SolverOptions Incumbent::solver(int iterations, const std::string& stage) const {
  return {.iterations = iterations, .enough = 0.1, .tick = [this, stage] { tick_(stage); }};
}

double Incumbent::log_likelihood_ratio(const Fit& with) const {
  return log_likelihood_ratio_beside_error(residuals(), noise_, fit_, with);
}

double Incumbent::log_likelihood_ratio(const Comparison& with) const {
  return log_likelihood_ratio_beside_error(noise_, training_, with.training, task_.train);
}

// Measured less simulated over the noise.
Signals Incumbent::miss(const HypothesisPoint& at, const std::vector<std::size_t>& recordings) const {
  const WhitenedRecordings fine(*task_.bench, *task_.noise, recordings, simulation_, task_.threads);
  if (!noise_is_only_error()) return predict(fine, at.hypothesis, at.z).standardized;
  const WhitenedRecordings coarse(*task_.bench, *task_.noise, recordings, residuals().simulation(),
                                  task_.threads);
  return predict(fine, coarse, at.hypothesis, at.z).standardized;
}

std::optional<Comparison> Incumbent::weigh(const HypothesisPoint& next) const {
  const auto share_by_noise = [](const Signals& before, const Signals& after) {
    return 1 - excess_squares(after) / excess_squares(before);
  };
  const auto share_of = [&](const Signals& before, const Signals& after, const auto& recordings) {
    if (noise_is_only_error()) return share_by_noise(before, after);
    return 1 -
           excess_beside_error(noise_, after, recordings) / excess_beside_error(noise_, before, recordings);
  };
  Comparison out;
  try {
    out = {.training = miss(next, task_.train), .held_out = miss(next, task_.held_out)};
  } catch (const Error& failure) {
    if (failure.code() != ErrorCode::numerical) throw;
    return std::nullopt;
  }
  out.share = share_of(training_, out.training, task_.train);
  // The held-out recordings count only if they show lack of fit before or after or, with noise as the only
  // error, if their sum of squares rises by more than a detection. Otherwise they say nothing about the
  // trial.
  const auto& how = task_.selection;
  const auto rises = [&] {
    return noise_is_only_error() && excess_squares(out.held_out) > excess_squares(held_out_) + how.detection;
  };
  if (!task_.held_out.empty() && (shows(held_out_, how) || shows(out.held_out, how) || rises()))
    // By noise as well: so the proof will count.
    out.share_held_out =
        std::min(share_of(held_out_, out.held_out, task_.held_out), share_by_noise(held_out_, out.held_out));
  return out;
}

// By how much the effect, right or wrong, acts on its channel of the held-out recordings.
double Incumbent::action_on_held_out(const HypothesisPoint& next, const Effect& effect,
                                     const Comparison& trial) const {
  HypothesisPoint without{without_effect(next.hypothesis, std::string(effect.id)), {}};
  without.z = carried_over(without.hypothesis, next.hypothesis, next.z);
  const auto lacking = miss(without, task_.held_out);
  return squares_of_change({*task_.bench, noise_, task_.held_out, lacking, trial.held_out}, *trial.channel);
}

// The comparison in the channel of the effect's sensor.
Comparison Incumbent::in_its_channel(Comparison trial, const HypothesisPoint& next,
                                     const Effect& effect) const {
  auto taken = excess_taken({*task_.bench, noise_, task_.train, training_, trial.training}, *trial.channel);
  trial.share_held_out.reset();
  if (!task_.held_out.empty()) {
    const auto held_out =
        excess_taken({*task_.bench, noise_, task_.held_out, held_out_, trial.held_out}, *trial.channel);
    // Whether it could take its share there.
    const bool shows =
        action_on_held_out(next, effect, trial) > task_.selection.material_share * held_out.before;
    if (shows) taken = {taken.before + held_out.before, taken.left + held_out.left};
    if (shows || held_out.share() < -most_lost_beside_sensor) trial.share_held_out = held_out.share();
  }
  trial.share = taken.share();
  return trial;
}

std::optional<Comparison> Incumbent::weigh(const HypothesisPoint& next, const Effect& effect) const {
  auto out = weigh(next);
  const auto channel = channel_of(effect.family);
  if (!out || !channel || noise_is_only_error() || out->share <= 0) return out;
  if (is_of_the_motion({*task_.bench, noise_, task_.train, training_, out->training}, *channel)) return out;
  out->channel = channel;
  try {
    return in_its_channel(*std::move(out), next, effect);
  } catch (const Error& failure) {
    if (failure.code() != ErrorCode::numerical) throw;
    return std::nullopt;
  }
}

HypothesisPoint Incumbent::fitted_beside_its_own_error(HypothesisPoint trial) const {
  auto errors = noise_;
  Signals before = training_;
  for (int i = 0; i < most_rounds_of_error; ++i) {
    auto training = miss(trial, task_.train);
    if (log_likelihood_ratio_beside_error(errors, before, training, task_.train) < least_gain_of_round) break;
    estimate_errors(training, miss(trial, task_.held_out), errors);
    trial = fitted_beside(errors, std::move(trial), solver(12, "fitting beside the model's error"));
    before = std::move(training);
  }
  return trial;
}

HypothesisPoint Incumbent::fitted(HypothesisPoint at, const SolverOptions& options) const {
  return fitted_beside(noise_, std::move(at), options);
}

// By simulations that are fine enough there: what serves the incumbent may be nothing but grain elsewhere.
HypothesisPoint Incumbent::fitted_beside(const std::vector<std::vector<NoiseModel>>& errors,
                                         HypothesisPoint at, const SolverOptions& options) const {
  WhitenedRecordings coarse(*task_.bench, errors, task_.train, simulation_, task_.threads),
      fine(*task_.bench, errors, task_.train, simulation_, task_.threads);
  auto exact = choose_simulations(coarse, fine, at, task_.simulation.domains);
  Fit fit;
  fit.hypothesis = std::move(at.hypothesis);
  fit.z = std::move(at.z);
  minimize_corrected(coarse, fine, std::move(exact), fit, options);
  return {std::move(fit.hypothesis), std::move(fit.z)};
}

bool Incumbent::is_gross(const HypothesisPoint& at) const {
  const WhitenedRecordings fine(*task_.bench, *task_.noise, task_.train, simulation_, task_.threads);
  return inference::is_gross(fine, at.hypothesis, at.z);
}

void Incumbent::settle(int rounds) {
  if (noise_is_only_error()) rounds = 1;  // there is no error to agree with
  look();
  for (int i = 0; i < rounds; ++i) {
    stand(at_, training_, held_out_);
    move(refitted());
    look();
  }
}

// What is tried next is weighed against what the model misses where it stands, not before its last fit.
void Incumbent::look() {
  tick_("how wrong the model is");
  training_ = miss(at_, task_.train);
  held_out_ = miss(at_, task_.held_out);
}

void Incumbent::settle_at(HypothesisPoint next) {
  at_ = std::move(next);
  settle();
}

void Incumbent::settle_with_trusted_instruments() {
  trust_instruments(at_.hypothesis, at_.z);
  settle();
}

void Incumbent::settle_with_free_base() {
  widen_priors(at_.hypothesis, at_.z);
  settle_with_trusted_instruments();
}

// All together: what is usual of a channel cannot be said by the few that are held out.
void Incumbent::estimate_errors(Signals training, const Signals& held_out,
                                std::vector<std::vector<NoiseModel>>& errors) const {
  auto recordings = task_.train;
  recordings.insert(recordings.end(), task_.held_out.begin(), task_.held_out.end());
  training.insert(training.end(), held_out.begin(), held_out.end());
  estimate_model_errors(*task_.bench, training, recordings, errors);
}

// The model's error by what it misses there, and the fit there, beside that error or by noise.
void Incumbent::stand(HypothesisPoint at, Signals training, Signals held_out) {
  at_ = std::move(at);
  training_ = std::move(training);
  held_out_ = std::move(held_out);
  estimate_errors(training_, held_out_, noise_);
  material_ = is_error_material(*task_.bench, noise_, task_.train, task_.floor);
  fit_.fresh = false;
  fit_.jacobian.resize(0, 0);  // it is that of another hypothesis, or under other pasts
  if (!noise_is_only_error()) fit_.fidelity_correction = weigh_rows();
  fit_ = minimize(residuals(), at_.hypothesis, at_.z, {.iterations = 0, .tick = {}}, &fit_);
}

Fit Incumbent::refitted() const {
  Fit out;
  if (noise_is_only_error()) {
    out = minimize(residuals(), at_.hypothesis, at_.z, solver(12, "refitting"), &fit_);
  } else {
    out = fit_;
    minimize_corrected(*residuals_, *fine_, out, solver(12, "fitting beside the model's error"));
  }
  if (!out.fresh) refresh_jacobian(residuals(), out);
  return out;
}

void Incumbent::move(Fit to) {
  fit_ = std::move(to);
  at_.z = fit_.z;
}

// The residuals beside the model's error, by simulations that are fine enough where the model stands now.
// Returns the fidelity correction there.
Eigen::VectorXd Incumbent::weigh_rows() {
  residuals_ =
      std::make_unique<WhitenedRecordings>(*task_.bench, noise_, task_.train, simulation_, task_.threads);
  fine_ = std::make_unique<WhitenedRecordings>(*task_.bench, noise_, task_.train, simulation_, task_.threads);
  const auto exact = choose_simulations(*residuals_, *fine_, at_, task_.simulation.domains);
  simulation_ = fine_->simulation();
  return exact - residuals_->evaluate(at_.hypothesis, at_.z);
}

// Whether it is kept.
bool Incumbent::refit() {
  auto fit = refitted();
  auto after = weigh({at_.hypothesis, fit.z});
  if (!after || after->smaller_share() < -most_lost) return false;
  move(std::move(fit));
  training_ = std::move(after->training);
  held_out_ = std::move(after->held_out);
  return true;
}

void Incumbent::accept(HypothesisPoint next, Comparison trial) {
  stand(std::move(next), std::move(trial.training), std::move(trial.held_out));
  refit();
}

// How much is missed: by noise where that is the only error, else over the ranges, as pasts are chosen. By an
// error of each channel's own, what a channel that is met badly gains from another past would hardly count.
double Incumbent::amount_of(const Signals& missed, const std::vector<std::size_t>& recordings) const {
  if (noise_is_only_error()) return excess_squares(missed);
  double out = 0;
  for (std::size_t i = 0; i < recordings.size(); ++i)
    for (std::size_t c = 0; c < missed[i].size(); ++c)
      out += std::pow(noise_[recordings[i]][c].std() / (*task_.bench)[recordings[i]].channels[c].range, 2) *
             mean_square(missed[i][c]);
  return out;
}

void Incumbent::refit_under_other_pasts() {
  const auto stood = pasts();
  const auto training = training_, held_out = held_out_;
  if (!choose_pasts(at_)) return;
  bool less = false;
  try {
    look();
    less = amount_of(training_, task_.train) < amount_of(training, task_.train) &&
           amount_of(held_out_, task_.held_out) <= (1 + most_lost) * amount_of(held_out, task_.held_out);
  } catch (const Error& failure) {
    if (failure.code() != ErrorCode::numerical) throw;
  }
  if (!less) {
    task_.set_pasts(stood);
    return stand(at_, training, held_out);
  }
  stand(at_, training_, held_out_);
  if (refit()) stand(at_, training_, held_out_);
}

std::vector<protocols::Past> Incumbent::pasts() const {
  return pasts_of(*task_.bench);
}

// A model that is wrong by much misses its channels alike, over their ranges, and so the misses are counted.
// An error of each channel's own would let a past be taken that meets one channel far better than the model
// can, at the other's cost.
bool Incumbent::choose_pasts(const HypothesisPoint& at) const {
  if (!task_.choose_pasts) return false;
  tick_("choosing the specimen's past");
  const auto stood = pasts();
  const auto chosen = task_.choose_pasts(setting_at(at.hypothesis, at.z).model);
  task_.set_pasts(chosen);
  return chosen != stood;
}

}  // namespace ferrobench::model::inference

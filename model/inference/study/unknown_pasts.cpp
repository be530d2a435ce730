#include "model/inference/study/unknown_pasts.h"

#include <algorithm>
#include <cmath>

#include "model/inference/common/parallel.h"
#include "model/inference/search/pasts.h"
#include "model/inference/solver/covariance.h"
#include "model/inference/solver/multifidelity.h"
#include "model/inference/study/validation.h"
#include "model/inference/study/workflow.h"

namespace ferrobench::model::inference {
namespace {

using protocols::FirstState;
using protocols::Past;
using protocols::PastKind;

// Corrections of a coarse fit by the fine simulation; each moves it less.
constexpr int corrections = 2;
// At a partial reversal fewer domains than these tell one past from another by the grain of their own sum.
constexpr int domains = 4000;
// Times that pasts are chosen anew, each followed by a fit.
constexpr int most_rounds = 6;
// Fits beside another origin of a visit, before it is judged.
constexpr int rounds_of_origin = 3;
// A round that gains less than this was the last one: half of what a level has to earn.
constexpr double last_round_gain = 30;
// -2 ln L that a free level has to earn, as an effect has to (selection/selection_options.h).
constexpr double level_gain = 60;
// Mean square of the residuals that no other past is asked to better: it is noise.
constexpr double enough = 1.1;

SimulationOptions finely(const UnknownPasts& of) {
  auto out = of.simulation;
  out.domains = domains;
  return out;
}

// By coarse simulations, corrected where they lead to.
Fit recalibrated(const UnknownPasts& of, const Hypothesis& base, const Eigen::VectorXd& from) {
  WhitenedRecordings coarse(of.bench, of.noise, of.train, of.simulation, of.threads),
      fine(of.bench, of.noise, of.train, finely(of), of.threads);
  coarse.marginalize_drive(base, from);
  fine.marginalize_as(coarse);
  const SolverOptions solver{
      .iterations = 12, .enough = 5, .tick = [&] { of.tick("recalibrating the model"); }};
  Fit out = minimize(coarse, base, from, solver);
  for (int i = 0; i < corrections; ++i) {
    apply_fidelity_correction(coarse, fine, out);
    out = minimize(coarse, std::move(out), solver);
  }
  apply_fidelity_correction(coarse, fine, out);
  return out;
}

// One recording where a fit stands.
class OneRecording {
 public:
  OneRecording(const UnknownPasts& of, std::size_t r, const Hypothesis& hypothesis, const Eigen::VectorXd& z)
      : bench_{of.bench[r]},
        noise_{of.noise[r]},
        presumed_(of.by_succession[r]),
        by_(finely(of)),
        hypothesis_(hypothesis),
        z_(z) {}

  Past likeliest() {
    const auto how = search();
    const auto found = likeliest_past(bench_.front().knot_time, bench_.front().knot_field, how);
    return found ? found->past : bench_.front().header.past;
  }
  Past refined() {
    const auto visit = bench_.front().header.past;
    return refined_past(bench_.front().knot_field, visit, search()).past;
  }

 private:
  Eigen::VectorXd residual(const Past& past) {
    bench_.front().header.past = past;
    return WhitenedRecordings(bench_, noise_, {0}, by_, 1).evaluate(hypothesis_, z_);
  }
  PastMisfit misfit(const Past& past) {
    const auto left = residual(past);
    if (WhitenedResiduals::is_unsolved(left)) return {};
    return {left.squaredNorm(), static_cast<double>(left.size()) / correlated_rows(left)};
  }
  PastSearch search() {
    const double noise_alone = enough * WhitenedRecordings(bench_, noise_, {0}, by_, 1).samples();
    return {.misfit = [this](const Past& p) { return misfit(p); },
            .degrees = false,
            .level_gain = level_gain,
            .enough = noise_alone,
            .presumed = presumed_,
            .not_doubted = noise_alone,
            .residual = [this](const Past& p) { return residual(p); }};
  }

  std::vector<BenchRecording> bench_;
  const std::vector<std::vector<NoiseModel>> noise_;
  const std::vector<Past>& presumed_;
  SimulationOptions by_;
  const Hypothesis& hypothesis_;
  const Eigen::VectorXd& z_;
};

}  // namespace

void set_pasts(const UnknownPasts& of, const std::vector<Past>& pasts) {
  for (std::size_t r = 0; r < of.bench.size(); ++r) {
    of.bench[r].header.past = pasts[r];
    of.bench[r].past_is_free =
        of.unknown[r] && pasts[r].kind == PastKind::visited && pasts[r].levels.size() == 1;
  }
}

void hold_pasts(std::vector<BenchRecording>& bench, const std::vector<Past>& pasts) {
  for (std::size_t r = 0; r < bench.size(); ++r) {
    bench[r].past_is_free = bench[r].past_is_free && bench[r].header.past == pasts[r];
    bench[r].header.past = pasts[r];
  }
}

void refine_pasts(const UnknownPasts& of, const Hypothesis& hypothesis, const Eigen::VectorXd& z) {
  in_parallel(of.bench.size(), of.threads, [&](std::size_t r) {
    if (of.bench[r].past_is_free) of.bench[r].header.past = OneRecording(of, r, hypothesis, z).refined();
  });
}

std::vector<Past> pasts_of(const std::vector<BenchRecording>& bench) {
  std::vector<Past> out;
  out.reserve(bench.size());
  for (const auto& r : bench) out.push_back(r.header.past);
  return out;
}

std::vector<Past> likeliest_pasts(const UnknownPasts& of, const Hypothesis& hypothesis,
                                  const Eigen::VectorXd& z) {
  auto out = pasts_of(of.bench);
  in_parallel(out.size(), of.threads, [&](std::size_t r) {
    of.tick("choosing the specimen's past");
    if (of.unknown[r]) out[r] = OneRecording(of, r, hypothesis, z).likeliest();
  });
  return out;
}

std::vector<Past> likeliest_pasts_as_given(const Model& model, const std::vector<RecordingData>& data,
                                           SimulationOptions watched) {
  // As the starts of a fit are simulated (study/fit.h).
  watched.tolerance = 1e-3;
  watched.domains = 128;
  return choose_pasts({&model, 1}, data,
                      {.fidelity = {.simulation = watched, .coarse = true},
                       .heights_are_free = true,
                       .presumed = Past{PastKind::poled_plus}});
}

std::vector<Past> likeliest_pasts_over_range(const Model& model, const std::vector<RecordingData>& data,
                                             SimulationOptions watched) {
  // Of loops that a bulk ceramic's model goes through at a third of its switching, 1,000 domains are 1 to 5 %
  // of the range off, 4,000 less than 1 %, at a tolerance of 1e-3 as at a finer one.
  watched.tolerance = 1e-3;
  watched.domains = domains;
  return choose_pasts({&model, 1}, data, {.fidelity = {.simulation = watched, .coarse = true}});
}

namespace {

// Pasts and numbers in turn, from where both stand.
class Settling {
 public:
  Settling(const UnknownPasts& of, const Hypothesis& base, std::vector<Past> pasts)
      : of_(of), base_(base), pasts_(std::move(pasts)) {
    set_pasts(of_, pasts_);
    fit_ = recalibrated(of_, base_, prior_mean(base_));
  }

  const Fit& fit() const { return fit_; }
  const std::vector<Past>& pasts() const { return pasts_; }
  bool is_gross() const {
    const WhitenedRecordings residuals(of_.bench, of_.noise, of_.train, of_.simulation, of_.threads);
    return inference::is_gross(residuals, base_, fit_.z);
  }

  void run() {
    for (int round = 0; round < most_rounds; ++round) {
      auto next = likeliest_pasts(of_, base_, fit_.z);
      if (next == pasts_ || try_pasts(std::move(next)) < last_round_gain) break;
    }
    // The numbers were fitted to a wrong kind of visit by then, so a right one has to show beside its own.
    for (std::size_t r = 0; r < pasts_.size() && leaves_much(); ++r)
      if (of_.bench[r].past_is_free) try_other_origin(r);
  }

 private:
  bool leaves_much() const { return fit_.squares > enough * static_cast<double>(fit_.residual.size()); }

  // What is gained; pasts that gain nothing are not kept.
  double try_pasts(std::vector<Past> next) {
    set_pasts(of_, next);
    auto refitted = recalibrated(of_, base_, fit_.z);
    const double gained = fit_.squares - refitted.squares;
    if (gained > 0) {
      pasts_ = std::move(next);
      fit_ = std::move(refitted);
    }
    set_pasts(of_, pasts_);
    return gained;
  }

  // A visit from the far side for one from an unpoled specimen, or the other way round.
  void try_other_origin(std::size_t r) {
    const auto stood = pasts_;
    const auto before = fit_;
    auto& past = pasts_[r];
    past.from = past.from != FirstState::unpoled ? FirstState::unpoled
                : past.levels.front().field < 0  ? FirstState::poled_plus
                                                 : FirstState::poled_minus;
    set_pasts(of_, pasts_);
    for (int round = 0; round < rounds_of_origin; ++round) {
      refine_pasts(of_, base_, fit_.z);
      pasts_ = pasts_of(of_.bench);
      fit_ = recalibrated(of_, base_, fit_.z);
    }
    if (before.squares - fit_.squares > last_round_gain) {
      try_pasts(likeliest_pasts(of_, base_, fit_.z));
      return;
    }
    pasts_ = stood;
    fit_ = before;
    set_pasts(of_, pasts_);
  }

  const UnknownPasts& of_;
  const Hypothesis& base_;
  std::vector<Past> pasts_;
  Fit fit_;
};

}  // namespace

SettledPasts settle_pasts(const UnknownPasts& of, const Hypothesis& base) {
  auto presumed = pasts_of(of.bench);
  Settling found(of, base, presumed);
  const bool gross = found.is_gross();
  for (std::size_t r = 0; r < presumed.size(); ++r)
    if (of.unknown[r]) presumed[r] = Past{PastKind::poled_plus};
  const Settling by_presumed(of, base, presumed);
  // By noise a model that is wrong by much goes anywhere, and says nothing of pasts.
  if (gross && by_presumed.is_gross()) {
    hold_pasts(of.bench, found.pasts());
    return {};
  }
  // Where what is presumed does no worse from the beginning, the others were chosen under a model that misses
  // something.
  if (found.fit().squares < by_presumed.fit().squares) {
    set_pasts(of, found.pasts());
    found.run();
    if (found.fit().squares < most_left_by_another_past * by_presumed.fit().squares)
      return {false, found.fit().z};
  }
  set_pasts(of, presumed);
  return {true, by_presumed.fit().z};
}

}  // namespace ferrobench::model::inference

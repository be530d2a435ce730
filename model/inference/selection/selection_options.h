// Every threshold by which `discover` decides, with its reason.
//
// A drop is a decrease of the sum of squares of a fit: twice a difference of log-likelihoods. Were
// simulations exact and noise white and normal, a drop of 15 would be significant. They are not: two programs
// that solve the same equations well differ by a few parts in ten thousand of what switches.
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <string_view>
#include <variant>

namespace ferrobench::model::inference {

struct SelectionOptions {
  // Detection, by the difference of the Bayesian information criterion (BIC, G. Schwarz 1978) to the base
  // model.
  double detection = 60;  // An effect is detected by more than this. What another program's simulations
                          // of the base model differ by stays below it at a noise of 0.1 % of the range;
                          // where it is less, this is raised (`raise_detection`).
  double second_detection = 60;  // A second effect must take off as much again.
  // What an explanation may leave relative to what it explains. Two programs agree to a few parts in 10,000.
  double relative_remainder = 1e-4;
  // The noise's level is estimated to a few percent, so mean squares may be off by twice that. A larger
  // excess over 1 is lack of fit, whatever its cause.
  double lack_of_fit = 0.2;
  // A base fit with mean squares above this has made up for what is missing with parameters that are now
  // wrong, so that local steps from it mislead, and effects are refitted from the parameters as given too.
  double misled_base = 1.2;
  // An effect that seems to explain something may only have led the base model to a better minimum. That is
  // believed if the base model's fit there is better by this drop.
  double better_base = 12;

  // A base model that leaves so many detections above the noise, and that an effect beats by as many, is
  // rejected without being taken to the end of the fine simulation, which costs as much as all the rest.
  // This is no bound on what that end would gain: on 17 benches of the campaign that was 6 to 15,000 of the
  // sum of squares, 124 in the median, a tenth of what was left at most where it was more than 1,700. A base
  // that does better by as many detections where the effect led it is looked for.
  double unfinished_base = 10;
  // Relative, of the mean squares of the noise: its level is known to a percent. A fit that leaves no more
  // than this above the noise needs no other starts, since none leads to less.
  double noise_uncertainty = 0.02;

  // Screening, by the score test (selection/screening.h).
  double refit_share_of_detection =
      0.3;                            // Effects that promise less of `detection` than this are not refitted,
  double refit_share_of_best = 0.02;  // nor are those that promise less than this of the best one's drop.
  double testable = 9;  // An effect is called not testable if at its largest plausible size it would change
                        // the residuals by less than three standard deviations.

  // How much is tried; costs grow with these.
  std::size_t single_refits = 10;     // effects refitted alone, by the order of the screen
  std::size_t compared = 3;           // of the best, fitted to the end so that they can be compared
  std::size_t first_effects = 2;      // of the best, beside which second effects are looked for
  std::size_t second_effects = 4;     // beside each of these
  std::size_t checked_pairs = 3;      // of the best pairs, asked whether they are enough
  std::size_t plausible_refits = 3;   // of all effects from plausible strengths, gone on with
  std::size_t starts_per_effect = 2;  // starts of one effect that are gone on with after a first step
  std::size_t starts_in_all = 12;     // likewise, of all effects
  std::size_t stepped_starts = 24;    // beside a fit: starts that promise enough for that first step
  double abandoned = 2;           // A fit begun is abandoned if its sum of squares is so many times the best.
  double trusted_decrease = 3;    // or if it stays behind the best even if it gains so many times what a
                                  // Gauss-Newton step promises: promises are linear.
  double wild_step = 5;           // A linear guess that moves a parameter by more prior standard deviations
                                  // than this is not used.
  std::size_t base_restarts = 2;  // times that everything is asked again from a better base fit

  // Sufficiency: the remainder after an explanation, over the one that is allowed (`allowed_remainder`).
  // A fit whose remainder is above the first is not taken to its end if the remainder is so many times (the
  // second) what a Gauss-Newton step promises to gain.
  double unfinished_remainder = 3;
  double unfinished_decrease = 10;
  double reachable_remainder = 30;   // Above this, no fit is taken to its end and no other partner is tried.
  double hopeless_remainder = 1000;  // Above this, nothing more is tried.
  // Where nothing is sufficient, the model's own physics may be off by a little in all recordings. An effect
  // is named all the same if it takes away at least this share of the excess over noise that stood before it:
  // an effect of twice what the physics leaves takes 0.8, and what physics alone leaves is imitated by an
  // effect to about a half.
  double material_share = 0.7;
  // Explanations are compared with those near the top: within three times `second_detection`, or within this
  // share of the best one's drop.
  double comparable_share = 0.05;

  // A few numbers (a table's cells): they cannot tell two effects apart, and many starts fit them by chance.
  bool single_effect = false;

  // Probabilities and verdict (selection/verdict.h).
  // Likelihoods are tempered (raised to 1/12), since residuals of two honest programs are not independent;
  // the campaign's stated probabilities come true with it.
  double likelihood_tempering = 12;
  double confident = 0.9;  // An effect is named if its probability among the explanations is above this.
  double detection_width = 0.15;  // Width of the logistic rise of the probability at `detection`, relative.
  double sufficiency_power = 3;   // P(unknown) = x^p / (1 + x^p), x the best remainder over the allowed one.
  double least_probability = 1e-4;  // Relative to the best; explanations below it are not told.
  double plausible_margin =
      1.1;                 // Plausible ranges in the catalogue have one digit, so values may be 10 % out.
  double equivalent = 20;  // Explanations closer in BIC than this are told as not to be told apart.

  // The experiment that would decide (selection/experiment_design.h).
  double decisive_odds = 3;          // Expected odds below this are no reason for an experiment.
  double longest_experiment = 3600;  // s
  std::size_t experiment_rows = 600;

  // To at least this drop, of second effects too.
  void raise_detection(double drop);

  // False if a value makes no sense; then `error` says which and why.
  bool is_valid(std::string* error) const;
};

// A member of these options, for what goes through all of them: their validation, and the campaign that asks
// what halving and doubling each changes.
struct Threshold {
  // What it may be. To halve a value of the last two kinds is to halve its distance from one.
  enum class Range { positive, not_negative, share, at_least_one, below_one, above_one };
  std::string_view name;
  std::variant<double SelectionOptions::*, std::size_t SelectionOptions::*> member;
  Range range = Range::positive;
};
std::span<const Threshold> thresholds();

// With one of them times `factor`, in the sense of its range; numbers of things are rounded, to one at least.
SelectionOptions scaled(SelectionOptions options, const Threshold& threshold, double factor);
double value_of(const SelectionOptions& options, const Threshold& threshold);

}  // namespace ferrobench::model::inference

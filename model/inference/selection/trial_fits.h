// The fits behind forward selection: from several starts, from the parameters as given, to the end, and with
// some effects taken out again.
#pragma once

#include <optional>
#include <set>
#include <string>
#include <vector>

#include "model/inference/search/starts.h"
#include "model/inference/selection/forward_selection.h"
#include "model/inference/solver/multifidelity.h"

namespace ferrobench::model::inference {

// One start of the effect at each of these values of its parameters.
std::vector<EffectStart> starts_for(const Effect& effect, Starts starts);

// Keeps the first `most` trials of each set of effects.
void keep_of_each(std::vector<Trial>& trials, std::size_t most);
// Where the parameters of one of a trial's effects stand.
std::vector<double> effect_values(const Trial& trial, std::size_t which);

class TrialFits {
 public:
  // All of them must outlive it.
  TrialFits(const WhitenedResiduals& coarse, WhitenedResiduals& fine, const Fit& base,
            const SelectionTask& task, const SelectionOptions& options);

  double samples() const { return samples_; }
  void tick(const std::string& stage, double fraction) const;
  SolverOptions solver(const std::string& stage, double fraction) const;
  double allowed(const Trial& t) const { return allowed_remainder(options_, t.drop); }
  void sort_best_first(std::vector<Trial>& trials) const;
  bool is_misled(const Fit& fit) const { return fit.squares > options_.misled_base * samples_; }
  void set_fit(Trial& t, Fit fit) const;
  // Sums of squares above this are far behind the best.
  double comparable(double rival) const;

  // `from` with the base parameters as given and effects as they stand. Without an effect that is there the
  // parameters may have gone far astray, and then what was given is the better start.
  const Fit& as_given(const Fit& from);
  // The starts whose response, by the score test around `from`, promises most, at most so many of each effect
  // and in all (SelectionOptions). `from` must be a fit: elsewhere responses are no measure of what a refit
  // will gain.
  std::vector<EffectStart> promising(const Fit& from, const std::vector<EffectStart>& starts,
                                     const std::function<void()>& in_between) const;
  // A step from each start, two more from those that are best then, at most so many of each effect. Best
  // first.
  std::vector<Trial> begin(const Fit& from, const std::vector<const Effect*>& before,
                           const std::vector<EffectStart>& starts, std::size_t of_each,
                           const std::function<void()>& in_between) const;
  // Adds trials of `from` with one more effect. If `from` is misled, the effect is also fitted from the
  // parameters as given (from these alone with SelectionOptions::single_effect). Trials of only a few steps
  // are marked as `begun`, and finish() goes on with them.
  void refit(std::vector<Trial>& into, const Fit& from, const std::vector<const Effect*>& before,
             const Screened& screened, const SolverOptions& solver);
  // Goes on with those that were only begun, unless they are far worse than the best, and keeps one of each.
  void finish(std::vector<Trial>& trials, const SolverOptions& solver) const;
  // The base model from where a trial stands, with one of its effects or none.
  Fit reduced(const Trial& t, std::optional<std::size_t> kept, const SolverOptions& solver) const;
  // One effect of a pair without the other.
  Trial alone(const Trial& pair, std::size_t which) const;
  // To the end, with the simulations' own error taken out where the fit stands, unless it is plain already
  // that this is no explanation.
  void polish(Trial& t, const std::function<void()>& in_between) const;
  // A better minimum of the base model, if it has one near where the trial led it: what an effect seems to
  // explain, the base model may explain as well from there.
  std::optional<Fit> better_base(const Trial& best) const;
  // Singles that were fitted from the parameters as given.
  std::set<const Effect*> tried_as_given;

 private:
  // Whether a Gauss-Newton step promises that only noise is left. Makes the Jacobian anew if it has to.
  bool leads_to_noise(Fit& fit) const;
  Fit add_effect(const Fit& from, const Screened& screened, const SolverOptions& solver) const;
  static SolverOptions steps(int count, const std::function<void()>& in_between);

  const WhitenedResiduals& coarse_;
  WhitenedResiduals& fine_;
  const Fit& base_;
  const SelectionTask& task_;
  const SelectionOptions& options_;
  double samples_;
  std::optional<Fit> as_given_;  // of the fit with this sum of squares
  double as_given_from_ = 0;
};

}  // namespace ferrobench::model::inference

#include "model/inference/selection/trial_fits.h"

#include <algorithm>
#include <iterator>
#include <limits>
#include <map>
#include <utility>

#include "model/inference/common/parallel.h"
#include "model/inference/solver/projection.h"

namespace ferrobench::model::inference {
namespace {

// A first step changes the strength of an effect by no more than this factor.
constexpr double farthest_scale = 20;

}  // namespace

std::vector<EffectStart> starts_for(const Effect& effect, Starts starts) {
  std::vector<EffectStart> out;
  for (auto& values : starts) out.push_back({&effect, std::move(values)});
  return out;
}

void keep_of_each(std::vector<Trial>& trials, std::size_t most) {
  std::map<std::vector<const Effect*>, std::size_t> seen;
  std::erase_if(trials, [&](const Trial& t) { return ++seen[t.effects] > most; });
}

std::vector<double> effect_values(const Trial& t, std::size_t which) {
  const auto& h = t.fit.hypothesis;
  std::size_t i = h.base_count;
  for (std::size_t k = 0; k < which; ++k) i += t.effects[k]->parameters.size();
  std::vector<double> out;
  for (std::size_t k = 0; k < t.effects[which]->parameters.size(); ++k, ++i)
    out.push_back(h.parameters[i].value(t.fit.z[static_cast<Eigen::Index>(i)]));
  return out;
}

TrialFits::TrialFits(const WhitenedResiduals& coarse, WhitenedResiduals& fine, const Fit& base,
                     const SelectionTask& task, const SelectionOptions& options)
    : coarse_(coarse), fine_(fine), base_(base), task_(task), options_(options), samples_(coarse.samples()) {}

void TrialFits::tick(const std::string& stage, double fraction) const {
  if (task_.tick) task_.tick(stage, fraction);
}

SolverOptions TrialFits::solver(const std::string& stage, double fraction) const {
  return {.iterations = 10,
          .enough = 1,
          .trusted_decrease = options_.trusted_decrease,
          .tick = [this, stage, fraction] { tick(stage, fraction); }};
}

SolverOptions TrialFits::steps(int count, const std::function<void()>& in_between) {
  return {.iterations = count, .enough = 1, .tick = in_between};
}

void TrialFits::sort_best_first(std::vector<Trial>& trials) const {
  std::ranges::stable_sort(trials, std::greater<>(), [&](const Trial& t) { return delta_bic(t, samples_); });
}

double TrialFits::comparable(double rival) const {
  return rival + nearness(options_, base_.squares - rival);
}

void TrialFits::set_fit(Trial& t, Fit fit) const {
  t.fit = std::move(fit);
  t.drop = base_.squares - t.fit.squares;
}

const Fit& TrialFits::as_given(const Fit& from) {
  if (as_given_ && as_given_from_ == from.squares) return *as_given_;
  as_given_from_ = from.squares;
  as_given_ = from;
  as_given_->z.head(static_cast<Eigen::Index>(from.hypothesis.base_count)).setZero();
  apply_fidelity_correction(coarse_, fine_, *as_given_);
  refresh_jacobian(coarse_, *as_given_);
  return *as_given_;
}

std::vector<EffectStart> TrialFits::promising(const Fit& from, const std::vector<EffectStart>& starts,
                                              const std::function<void()>& in_between) const {
  const Projection projection(from);
  std::vector<std::pair<double, std::size_t>> drops;
  for (std::size_t begin = 0; begin < starts.size(); begin += responses_at_a_time) {
    if (in_between) in_between();
    const auto part = std::span(starts).subspan(begin, std::min(responses_at_a_time, starts.size() - begin));
    for (const auto& response : responses(coarse_, from, part)) {
      const Drop d = projection.drop(response);
      // Of the response at the strength that it asks for, as far as one step may lead there.
      const double scale =
          std::clamp(d.along / std::max(d.across, 1e-300), 1 / farthest_scale, farthest_scale);
      drops.emplace_back(d.at(scale), drops.size());
    }
  }
  std::ranges::stable_sort(drops, std::greater<>(), &std::pair<double, std::size_t>::first);
  std::map<const Effect*, std::size_t> seen;
  std::vector<EffectStart> out;
  for (const auto& [drop, i] : drops)
    if (seen[starts[i].effect]++ < options_.starts_per_effect) out.push_back(starts[i]);
  if (out.size() > options_.stepped_starts) out.resize(options_.stepped_starts);
  return out;
}

std::vector<Trial> TrialFits::begin(const Fit& from, const std::vector<const Effect*>& before,
                                    const std::vector<EffectStart>& starts, std::size_t of_each,
                                    const std::function<void()>& in_between) const {
  std::vector<Trial> out(starts.size());
  in_parallel(starts.size(), coarse_.threads(), [&](std::size_t i) {
    const auto hypothesis = with_effect(from.hypothesis, *starts[i].effect, starts[i].values);
    auto z = prior_mean(hypothesis);
    z.head(from.z.size()) = from.z;
    const auto stepped = minimize(coarse_, hypothesis, z, steps(1, in_between), &from);
    auto& t = out[i];
    t.effects = before;
    t.effects.push_back(starts[i].effect);
    t.fit.hypothesis = hypothesis;  // There are many, so residuals and Jacobian are not kept.
    t.fit.z = stepped.z;
    t.drop = base_.squares - stepped.squares;
  });
  sort_best_first(out);
  keep_of_each(out, of_each);
  if (out.size() > options_.starts_in_all) out.resize(options_.starts_in_all);
  in_parallel(out.size(), coarse_.threads(), [&](std::size_t i) {
    const auto& f = out[i].fit;
    set_fit(out[i], minimize(coarse_, f.hypothesis, f.z, steps(2, in_between), &from));
  });
  sort_best_first(out);
  return out;
}

// From where the base stands, with what the parameters would give up for the effect.
Fit TrialFits::add_effect(const Fit& from, const Screened& s, const SolverOptions& solver) const {
  const auto hypothesis = with_effect(from.hypothesis, *s.effect, s.values);
  auto z = prior_mean(hypothesis);
  z.head(from.z.size()) = from.z - Projection(from).taken(s.response + from.residual);
  // This guess is linear and leaves the priors' pull to the solver. Where it is wild, the base is the better
  // start.
  if ((z.head(from.z.size()) - from.z).cwiseAbs().maxCoeff() > options_.wild_step)
    z.head(from.z.size()) = from.z;
  return minimize(coarse_, hypothesis, z, solver, &from);
}

bool TrialFits::leads_to_noise(Fit& fit) const {
  if (!fit.fresh) refresh_jacobian(coarse_, fit);
  return fit.fresh && fit.may_reach((1 + options_.noise_uncertainty) * samples_, 1);
}

void TrialFits::refit(std::vector<Trial>& into, const Fit& from, const std::vector<const Effect*>& before,
                      const Screened& s, const SolverOptions& solver) {
  const auto add = [&](Fit f, bool begun) {
    auto& t = into.emplace_back();
    t.effects = before;
    t.effects.push_back(s.effect);
    set_fit(t, std::move(f));
    t.begun = begun;
  };
  const auto best_of = [&](Starts starts) {
    const auto of_each = options_.single_effect ? options_.starts_in_all : options_.starts_per_effect;
    return begin(as_given(from), before, starts_for(*s.effect, std::move(starts)), of_each, solver.tick)
        .front()
        .fit;
  };
  double rival = std::numeric_limits<double>::infinity();
  for (const auto& t : into) rival = std::min(rival, t.fit.squares);
  auto near = solver;
  near.wanted = comparable(rival);
  if (!is_misled(from)) return add(add_effect(from, s, near), false);
  if (options_.single_effect) {
    auto starts = starts_around(coarse_, *s.effect, s.values);
    std::ranges::move(plausible_starts(coarse_, *s.effect), std::back_inserter(starts));
    for (auto& values : starts) make_plausible(*s.effect, values);
    auto begun = best_of(std::move(starts));
    auto far = solver;  // tables are simulated in milliseconds
    far.iterations = 40;
    return add(minimize(coarse_, std::move(begun), far), false);
  }
  const auto to_the_end = near;
  near.iterations = 3;
  add(add_effect(from, s, near), true);
  if (auto& t = into.back(); leads_to_noise(t.fit)) {
    set_fit(t, minimize(coarse_, std::move(t.fit), to_the_end));
    t.begun = !leads_to_noise(t.fit);
    if (!t.begun) return;
  }
  // Where an effect leaves next to nothing, those that stay far behind it need no other starts.
  if (auto& t = into.back(); rival < options_.misled_base * samples_) {
    if (!t.fit.fresh) refresh_jacobian(coarse_, t.fit);
    if (!t.fit.may_reach(near.wanted, options_.trusted_decrease)) return;
  }
  // A second effect was screened beside the first, so its strength is about right.
  add(best_of(before.empty() ? starts_around(coarse_, *s.effect, s.values) : Starts{s.values}), true);
  if (before.empty()) tried_as_given.insert(s.effect);
}

void TrialFits::finish(std::vector<Trial>& trials, const SolverOptions& solver) const {
  sort_best_first(trials);
  double rival = trials.empty() ? 0 : trials.front().fit.squares;
  for (auto& t : trials) {
    if (!std::exchange(t.begun, false) || t.fit.squares > options_.abandoned * rival) continue;
    auto near = solver;
    near.wanted = comparable(rival);
    set_fit(t, minimize(coarse_, std::move(t.fit), near));
    rival = std::min(rival, t.fit.squares);
  }
  sort_best_first(trials);
  keep_of_each(trials, 1);
}

Fit TrialFits::reduced(const Trial& t, std::optional<std::size_t> kept, const SolverOptions& solver) const {
  const auto base_count = static_cast<Eigen::Index>(t.fit.hypothesis.base_count);
  const auto hypothesis =
      kept ? with_effect(base_.hypothesis, *t.effects[*kept], effect_values(t, *kept)) : base_.hypothesis;
  auto z = prior_mean(hypothesis);
  z.head(base_count) = t.fit.z.head(base_count);
  const Fit warm_start{.hypothesis = base_.hypothesis,
                       .z = {},
                       .residual = {},
                       .fidelity_correction = t.fit.fidelity_correction,
                       .jacobian = t.fit.jacobian.leftCols(base_count)};
  return minimize(coarse_, hypothesis, z, solver, &warm_start);
}

Trial TrialFits::alone(const Trial& pair, std::size_t which) const {
  Trial out;
  out.effects = {pair.effects[which]};
  set_fit(out, reduced(pair, which, solver("one effect: " + std::string(out.effects[0]->id), 0.88)));
  return out;
}

void TrialFits::polish(Trial& t, const std::function<void()>& in_between) const {
  if (t.polished) return;
  auto converged = converge_fine_fidelity(fine_, t.fit.hypothesis, t.fit.z, task_.most_domains);
  t.numerical_error = converged.error;
  apply_fidelity_correction(coarse_, std::move(converged.residual), t.fit);
  if (!t.fit.fresh) refresh_jacobian(coarse_, t.fit);
  t.drop = base_.squares - t.fit.squares;
  t.polished = true;
  if (task_.beyond_effects) {
    const double left = task_.beyond_effects(t.fit) / allowed(t);
    if (left > options_.reachable_remainder ||
        (left > options_.unfinished_remainder &&
         allowed(t) * left > options_.unfinished_decrease * t.fit.predicted_decrease()))
      return;
  }
  refine(coarse_, fine_, t.fit, LastSteps::cheap, in_between);
  t.drop = base_.squares - t.fit.squares;
}

std::optional<Fit> TrialFits::better_base(const Trial& best) const {
  if (best.fit.jacobian.size() == 0) return std::nullopt;
  const double gain =
      task_.base_is_final ? options_.better_base : options_.unfinished_base * options_.detection;
  auto options = solver("refitting the base model without effects", 0.5);
  options.wanted = base_.squares - gain;
  auto none = reduced(best, std::nullopt, options);
  const auto is_better = [&] { return none.squares < base_.squares - gain; };
  if (!is_better()) return std::nullopt;
  apply_fidelity_correction(coarse_, fine_, none);
  if (task_.base_is_final) refine(coarse_, fine_, none, LastSteps::fine, options.tick);
  if (!is_better()) return std::nullopt;
  return none;
}

}  // namespace ferrobench::model::inference

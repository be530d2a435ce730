#include "model/inference/study/inquiry.h"

#include <algorithm>

#include "model/inference/selection/candidates.h"
#include "model/inference/selection/experiment_design.h"
#include "model/inference/selection/leave_one_out.h"
#include "model/inference/selection/residual_basis.h"
#include "model/inference/solver/multifidelity.h"
#include "model/inference/study/validation.h"

namespace ferrobench::model::inference {
namespace {

// The fine simulation begins with these nodes, and ends with so many as make its error unnoticeable.
constexpr SimulationOptions fine_simulation{.tolerance = 1e-5, .domains = least_fine_domains, .shift = 7};
constexpr int most_domains = 16000;

// Progress at which the recalibration of the base has ended, and at which the proof begins.
constexpr double share_of_recalibration = 0.15, share_before_proof = 0.95;
// Share that a step is given of the progress that remains before the proof. Where a gap is narrowed after it,
// the selection of effects was measured to take about half of the time.
constexpr double share_of_step = 0.6;

// Residual and slopes where a fit stands, by noise alone.
void stand_at(const WhitenedRecordings& residuals, Fit& fit) {
  fit.fidelity_correction.resize(0);
  fit.residual = residuals.evaluate(fit.hypothesis, fit.z);
  fit.squares = fit.residual.squaredNorm() + prior_squares(fit.hypothesis, fit.z);
  fit.groups = residuals.groups();
  refresh_jacobian(residuals, fit);
}

}  // namespace

Inquiry::Inquiry(Session& session, const Model& base)
    : s_(session),
      base_(base_hypothesis(base, s_.bench)),
      coarse_(s_.bench, s_.noise, s_.train, s_.watched({}), s_.threads),
      fine_(s_.bench, s_.noise, s_.train, fine_for(base), s_.threads) {}

std::set<std::size_t> Inquiry::run() {
  s_.tick("choosing how finely to simulate", 0.01);
  const double error = choose_fidelities(coarse_, fine_, base_, prior_mean(base_), most_domains).error;
  s_.out.health.numerical_error_over_noise = error;
  s_.selection.raise_detection(error * error * fine_.samples());
  found_ = select(base_, true, s_.start, s_.selection);
  if (found_.gross) improve_gross();
  untestable_ = s_.out.not_testable;
  summarize(found_, s_.selection, s_.out);
  before_ = found_.base;
  after_ = found_.after();
  if (!found_.gross) compare_explanations();
  if (!found_.gross) improve_beyond_effects();
  if (improved_) tell_improvement();
  if (s_.out.verdict == Verdict::unknown) tell_where();
  return prove();
}

Ticker Inquiry::next_step() {
  const double from = done_;
  done_ += share_of_step * (share_before_proof - done_);
  return [this, from, to = done_](const std::string& stage, double f) {
    s_.tick(stage, from + (to - from) * f);
  };
}

SimulationOptions Inquiry::fine_for(const Model& base) const {
  auto out = s_.watched(fine_simulation);
  out.every_spread = adds_a_spread(base, s_.candidates);
  return out;
}

// Runs the workflow for this base, with the fidelities that coarse_ and fine_ have by now. The recalibration
// starts from `start` or, if that is empty, from the given values. With `unless_gross`, effects are not
// selected if the base is wrong by much. An explanation that the held-out recordings refute is taken back.
WorkflowResult Inquiry::select(const Hypothesis& base, bool unless_gross, Eigen::VectorXd start,
                               const SelectionOptions& selection) {
  auto out = run_workflow(
      coarse_, fine_, base,
      {.candidates = candidates_beside(base.model),
       .seed = s_.options.seed,
       .start = std::move(start),
       .most_domains = most_domains,
       .selection = selection,
       .roughly_fitted =
           [this](const Fit& f) {
             coarse_.marginalize_drive(f.hypothesis, f.z);
             fine_.marginalize_as(coarse_);
           },
       .is_gross = [this, unless_gross](
                       const Fit& f) { return unless_gross && is_gross(coarse_, f.hypothesis, f.z); },
       .beyond_effects = [this](const Fit& f) { return fit_residual_basis(coarse_, f).beyond_chance; },
       .tick = next_step()},
      s_.out.health);
  if (out.best != nullptr && !s_.held_out.empty() &&
      refute(out.selection, out.best->drop, held_out_excess(out), s_.selection))
    out.best = nullptr;
  return out;
}

// Narrows what a fit leaves.
std::optional<Improvement> Inquiry::narrow(const Fit& from, ImprovementTask& task) {
  task.tick = next_step();
  return improve(from, task, s_.out.health.warnings);
}

// Those that this model does not have.
std::vector<const Effect*> Inquiry::candidates_beside(const Model& model) const {
  auto out = s_.candidates;
  std::erase_if(out, [&](const Effect* e) {
    return std::ranges::any_of(model.effects, [e](const EffectSetting& has) { return has.id == e->id; });
  });
  return out;
}

WhitenedRecordings Inquiry::held_out_residuals(const SimulationOptions& simulation) const {
  return {s_.bench, s_.noise, s_.held_out, simulation, s_.threads};
}

// What the recalibrated base and the best explanation leave of the held-out recordings, above the noise, in
// the squares that the fits are made by: whitened, as they stand beside what the explanation takes of the
// training recordings. Pasts are those that stand, for it as for the base.
ExcessTaken Inquiry::held_out_excess(const WorkflowResult& found) const {
  if (s_.held_out.empty()) return {};
  auto held_out = held_out_residuals(fine_.simulation());
  held_out.marginalize_drive(found.base.hypothesis, found.base.z);
  const auto excess = [&](const Fit& f) {
    const auto residual = held_out.evaluate(f.hypothesis, f.z);
    double out = 0;
    for (const auto& b : held_out.blocks())
      out += excess_squares(std::span(residual.data() + b.begin, static_cast<std::size_t>(b.count)));
    return out;
  };
  return {excess(found.base), excess(found.best->fit)};
}

void Inquiry::improve_gross() {
  Fit given;
  given.hypothesis = base_;
  given.z = prior_mean(base_);
  done_ = share_of_recalibration;  // nothing but the recalibration was done so far
  auto task = improvement_task(s_, fine_.simulation());
  allow_far_search(s_, task);
  task.until_noise_may_judge = true;
  improved_ = narrow(given, task);
  if (!improved_ || is_gross(coarse_, improved_->hypothesis, improved_->z)) return;
  // The model is no longer wrong by much: an effect was large, or the first fit had ended in a wrong local
  // minimum. So effects are selected again, with noise as the only error.
  const bool base_alone = improved_->added.empty();
  if (!base_alone && std::ranges::all_of(improved_->added, &AddedTerm::empirical)) return;
  auto again = select(
      base_, false, base_alone ? carried_over(base_, improved_->hypothesis, improved_->z) : Eigen::VectorXd{},
      s_.selection);
  if (again.best != nullptr || base_alone) {
    found_ = std::move(again);
    improved_.reset();
  } else if (improved_->for_noise_to_judge) {
    task.until_noise_may_judge = false;
    improved_ = narrow(given, task);
  }
}

// How each explanation does on every recording in turn, and the experiment that would tell two apart.
void Inquiry::compare_explanations() {
  auto& out = s_.out;
  const auto& trials = found_.selection.trials;
  if (s_.train.size() > 1 && !out.explanations.empty()) {
    const auto without = leave_one_out_squares(coarse_, before_);
    for (std::size_t i = 0; i < out.explanations.size(); ++i)
      out.explanations[i].leave_one_out = compare_left_out(coarse_, without, trials[i].first->fit);
  }
  if (out.verdict != Verdict::ambiguous || trials.size() < 2) return;
  s_.tick("looking for the experiment that would decide", done_);
  out.next_experiment =
      choose_experiment(coarse_, s_.noise, trials[0].first->fit, trials[1].first->fit, s_.selection);
}

// A gross base counts under the pasts that are likeliest for it, as what was added does under its own.
void Inquiry::under_pasts_of_base(const std::function<void()>& what) {
  if (!found_.gross || !improved_) return what();
  const auto stood = pasts_of(s_.bench);
  hold_pasts(s_.bench, improved_->pasts_of_base);
  what();
  hold_pasts(s_.bench, stood);
}

void Inquiry::tell_improvement() {
  auto& out = s_.out;
  after_.hypothesis = improved_->hypothesis;
  after_.z = improved_->z;
  stand_at(coarse_, after_);
  out.added = improved_->added;
  if (!found_.gross && out.verdict == Verdict::unknown) {
    out.added.insert(out.added.begin(), terms_.begin(), terms_.end());
    estimate_terms(after_, after_.hypothesis, after_.z, s_.selection.likelihood_tempering, out.added);
  }
  if (found_.gross) {
    before_ = std::move(improved_->base);
    out.recalibrated = recalibrations(before_, s_.selection);
    out.recalibrated_base = model_at(before_, "Recalibrated beside its own error.");
    under_pasts_of_base([this] { stand_at(coarse_, before_); });
    if (improved_->named) summarize_named(*improved_, s_.selection, out);
  }
  if (improved_->searched)
    out.health.warnings.emplace_back("The whole range of the base model's parameters was searched again.");
  const bool empirical = std::ranges::any_of(out.added, &AddedTerm::empirical);
  out.improved = model_at(
      after_, !improved_->named ? gap_without_a_name
              : empirical ? "Recalibrated, with what was found missing, and empirical terms for the rest."
                          : "Recalibrated, with what was found missing.");
}

void Inquiry::tell_where() {
  const auto explained = fit_residual_basis(coarse_, before_);
  s_.out.family = explained.family;
  // So far off, plain functions of the signals would have to be of any size.
  if (!found_.gross) s_.out.signals = reconstruct_signals(coarse_, before_, explained);
}

std::set<std::size_t> Inquiry::prove() {
  s_.tick("the proof", share_before_proof);
  auto& out = s_.out;
  std::set<std::size_t> unexplained_held_out;
  const bool added = !out.added.empty();
  const auto predicted = [this](const WhitenedRecordings& of, const WhitenedRecordings& by, const Fit& f) {
    refine_pasts(unknown_pasts(s_), f.hypothesis, f.z);
    return found_.gross ? predict(of, f.hypothesis, f.z) : predict(of, by, f.hypothesis, f.z);
  };
  const auto figures_before = [&](const WhitenedRecordings& of, const WhitenedRecordings& by) {
    Prediction figures;
    under_pasts_of_base([&] { figures = predicted(of, by, before_); });
    return figures;
  };
  const auto before = figures_before(fine_, coarse_),
             after = added ? predicted(fine_, coarse_, after_) : before;
  out.where = excess_by_segment_class(fine_, before.standardized);
  out.train.before = rms_by_channel(fine_, before.standardized);
  out.train.after = rms_by_channel(fine_, after.standardized);
  out.share = share_explained(before.standardized, after.standardized);
  out.left = left_by_channel(fine_, after.standardized);
  out.remainder =
      remainder_of(out.left, excess_by_segment_class(fine_, after.standardized), s_.options.floor);
  if (out.remainder)
    out.remainder->family = fit_residual_basis(coarse_, after_, out.remainder->channel).family;
  if (!s_.held_out.empty()) {
    const auto held_out = held_out_residuals(fine_.simulation()),
               held_out_coarse = held_out_residuals(coarse_.simulation());
    const auto held_out_before = figures_before(held_out, held_out_coarse),
               held_out_after = added ? predicted(held_out, held_out_coarse, after_) : held_out_before;
    unexplained_held_out = unexplained(held_out, held_out_before.standardized, s_.selection);
    out.held_out.before = rms_by_channel(held_out, held_out_before.standardized);
    out.held_out.after = rms_by_channel(held_out, held_out_after.standardized);
    out.share_held_out = share_explained(held_out_before.standardized, held_out_after.standardized);
    out.traces = traces(held_out, held_out_before, held_out_after, 2, true);
  }
  // A term that was named alone by noise takes all that is taken; what each of two takes was not asked.
  if (!improved_ && out.added.size() == 1) {
    out.added.front().share = out.share;
    if (!s_.held_out.empty()) out.added.front().share_held_out = out.share_held_out;
  }
  tell_pasts(s_);
  for (auto& t : traces(fine_, before, after, 4, false)) out.traces.push_back(std::move(t));
  return unexplained_held_out;
}

}  // namespace ferrobench::model::inference

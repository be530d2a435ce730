#include "model/inference/study/inquiry.h"

#include <algorithm>
#include <cmath>

#include "model/inference/selection/candidates.h"
#include "model/inference/selection/experiment_design.h"
#include "model/inference/selection/leave_one_out.h"
#include "model/inference/selection/residual_basis.h"
#include "model/inference/solver/multifidelity.h"
#include "model/inference/study/validation.h"

namespace ferrobench::model::inference {
namespace {

// The fine simulation begins with these nodes, and ends with so many as make its error unnoticeable.
constexpr SimulationOptions fine_simulation{.tolerance = 1e-5, .domains = 1000, .shift = 7};
constexpr int most_domains = 16000;

// Of the time, until effects are selected, where a gap is narrowed afterwards (measured: about half); and
// until the base is recalibrated. Where nothing is to be narrowed, progress ends with a leap.
constexpr double share_of_selection = 0.6, share_of_recalibration = 0.15;
// And until effects are selected beside corrections of the kinetics.
constexpr double share_of_second_selection = 0.85;

// Residual and slopes where a fit stands, by noise alone.
void stand_at(const WhitenedRecordings& residuals, Fit& fit) {
  fit.fidelity_correction.resize(0);
  fit.residual = residuals.evaluate(fit.hypothesis, fit.z);
  fit.squares = fit.residual.squaredNorm() + prior_squares(fit.hypothesis, fit.z);
  fit.groups = residuals.groups();
  refresh_jacobian(residuals, fit);
}

constexpr auto gap_without_a_name = "Recalibrated, with terms that narrow a gap that has no name.";

bool is_correction(const AddedTerm& a) {
  return a.empirical && !find_effect(a.term.id).table;
}

// The share of the sum of squares above the noise's that is gone after; none is known better than by its
// standard deviation.
double share_of_excess(const Fit& before, const Fit& after, double samples) {
  const auto excess = [samples](const Fit& f) {
    return std::max(f.squares - samples, std::sqrt(2 * samples));
  };
  return 1 - excess(after) / excess(before);
}

// The base with the corrections that narrow its gap, whose numbers are its own from now on.
Hypothesis with_corrections(Hypothesis base, const Model& narrowed,
                            const std::vector<AddedTerm>& corrections) {
  for (const auto& a : corrections) {
    const auto& effect = find_effect(a.term.id);
    std::vector<double> values;
    for (const auto& p : effect.parameters)
      values.push_back(get_parameter(narrowed, "effects." + a.term.id + "." + std::string(p.name)));
    base = with_effect(base, effect, values);
  }
  base.base_count = base.parameters.size();
  return base;
}

}  // namespace

Inquiry::Inquiry(Session& session, const Model& base)
    : s_(session),
      base_(base_hypothesis(base, s_.bench)),
      coarse_(s_.bench, s_.noise, s_.train, s_.watched({}), s_.threads),
      fine_(s_.bench, s_.noise, s_.train, fine_for(base), s_.threads) {}

std::set<std::size_t> Inquiry::run() {
  s_.tick("choosing how finely to simulate", 0.01);
  const double error = choose_fidelities(coarse_, fine_, base_, prior_mean(base_), most_domains);
  s_.out.health.numerical_error_over_noise = error;
  s_.selection.raise_detection(error * error * fine_.samples());
  found_ = ask(base_, true, s_.start, {0, share_of_selection}, s_.selection);
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

SimulationOptions Inquiry::fine_for(const Model& base) const {
  auto out = s_.watched(fine_simulation);
  out.every_spread = adds_a_spread(base, s_.candidates);
  return out;
}

// With what was learned of the fidelities so far. Recalibrates from `start`, or from the given values.
WorkflowResult Inquiry::ask(const Hypothesis& base, bool unless_gross, Eigen::VectorXd start, Progress of,
                            const SelectionOptions& selection) {
  auto out = run_workflow(
      coarse_, fine_, base,
      {.candidates = s_.candidates,
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
       .tick = [this, of](const std::string& stage,
                          double f) { s_.tick(stage, of.from + (of.to - of.from) * f); }},
      s_.out.health);
  if (out.best != nullptr && !s_.held_out.empty() &&
      refute(out.selection, out.best->drop, locked_excess(out), s_.selection))
    out.best = nullptr;
  return out;
}

WhitenedRecordings Inquiry::locked_by(const SimulationOptions& simulation) const {
  return {s_.bench, s_.noise, s_.held_out, simulation, s_.threads};
}

// What the recalibrated base and the best explanation leave of the recordings that were locked away, above
// the noise. Pasts are those that stand, for it as for the base.
ExcessTaken Inquiry::locked_excess(const WorkflowResult& found) const {
  if (s_.held_out.empty()) return {};
  const auto fine = locked_by(fine_.simulation()), coarse = locked_by(coarse_.simulation());
  const auto excess = [&](const Fit& f) {
    return excess_squares(predict(fine, coarse, f.hypothesis, f.z).standardized);
  };
  return {excess(found.base), excess(found.best->fit)};
}

void Inquiry::improve_gross() {
  Fit given;
  given.hypothesis = base_;
  given.z = prior_mean(base_);
  auto task = improvement_task(s_, fine_.simulation(), share_of_recalibration);
  allow_far_search(s_, task);
  task.until_noise_may_judge = true;
  improved_ = improve(given, task, s_.out.health.warnings);
  if (!improved_ || is_gross(coarse_, improved_->hypothesis, improved_->z)) return;
  // A large effect, or a valley that noise alone did not lead out of: then noise is the measure after all.
  const bool base_alone = improved_->added.empty();
  if (!base_alone && std::ranges::all_of(improved_->added, &AddedTerm::empirical)) return;
  auto again = ask(base_, false,
                   base_alone ? carried_over(base_, improved_->hypothesis, improved_->z) : Eigen::VectorXd{},
                   {0, share_of_selection}, s_.selection);
  if (again.best != nullptr || base_alone) {
    found_ = std::move(again);
    improved_.reset();
  } else if (improved_->for_noise_to_judge) {
    task.until_noise_may_judge = false;
    improved_ = improve(given, task, s_.out.health.warnings);
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
  s_.tick("looking for the experiment that would decide", share_of_selection);
  out.next_experiment =
      choose_experiment(coarse_, s_.noise, trials[0].first->fit, trials[1].first->fit, s_.selection);
}

// Where nothing could be named, or what was named leaves a material rest.
void Inquiry::improve_beyond_effects() {
  if (found_.selection.verdict == Verdict::nothing_missing || found_.selection.sufficient) return;
  const bool unknown = s_.out.verdict == Verdict::unknown;
  if (!unknown && !is_material(fine_, after_.hypothesis, after_.z, s_.options.floor)) return;
  auto task = improvement_task(s_, fine_.simulation(),
                               terms_.empty() ? share_of_selection : share_of_second_selection);
  std::erase_if(task.corrections, [this](const Effect* e) {
    return std::ranges::any_of(terms_, [e](const AddedTerm& a) { return a.term.id == e->id; });
  });
  if (unknown)
    task.by_noise = &coarse_;
  else
    task.named = s_.out.added;
  task.tables_beside_corrections = !unknown || !terms_.empty();
  auto improved = improve(after_, task, s_.out.health.warnings);
  if (improved && !task.tables_beside_corrections && std::ranges::any_of(improved->added, is_correction)) {
    if (ask_beside_corrections(*improved)) return improve_beyond_effects();
    task.tables_beside_corrections = true;
    improved = improve(after_, task, s_.out.health.warnings);
  }
  if (improved && unknown && ask_beside_tables(*improved)) return;
  if (!improved || improved->added.size() == task.named.size()) return;
  // Beside a name that was done beside the model's error, with instruments as they were stated. It may end
  // above where noise alone had led, and is of no use then.
  if (unknown || squares_at(*improved) < after_.squares) improved_ = std::move(improved);
}

// Of the residual and the priors, by noise alone.
double Inquiry::squares_at(const Improvement& narrowed) const {
  return coarse_.evaluate(narrowed.hypothesis, narrowed.z).squaredNorm() +
         prior_squares(narrowed.hypothesis, narrowed.z);
}

// A name is given beside empirical terms if nothing is left, and if the effect takes as much of what they
// leave as it has to where a model is wrong a little: they stand for what has no name, and do so nearly.
bool Inquiry::is_named_beside_terms(const WorkflowResult& again) const {
  return again.best != nullptr && again.selection.sufficient &&
         share_of_excess(again.base, again.best->fit, coarse_.samples()) >= s_.selection.material_share;
}

// Corrections of the kinetics make another base. Recalibrated from where the base was given it may end in
// another valley, and beside it effects may show that the wrong base hid. Whether that leads farther down;
// then it takes the place of what was found.
bool Inquiry::ask_beside_corrections(const Improvement& narrowed) {
  std::vector<AddedTerm> corrections;
  std::ranges::copy_if(narrowed.added, std::back_inserter(corrections), is_correction);
  const double stood = squares_at(narrowed);
  auto again = ask(with_corrections(base_, setting_at(narrowed.hypothesis, narrowed.z).model, corrections),
                   false, {}, {share_of_selection, share_of_second_selection}, s_.selection);
  const bool named = is_named_beside_terms(again);
  if ((named ? again.best->fit : again.base).squares > stood) return false;
  terms_ = std::move(corrections);
  tell_beside_terms(std::move(again), named, s_.selection);
  return true;
}

// An effect that did not take its share of the gap may have shared it with physics that has no name. Where
// tables narrow it beside the effect they become part of the base as they stand, the effect is taken out, and
// the workflow is gone through from there. Tables only stand for what is true, so an effect is sufficient
// beside them that takes its share of what they leave. Whether one is named.
bool Inquiry::ask_beside_tables(const Improvement& narrowed) {
  Hypothesis base = narrowed.hypothesis;
  std::vector<AddedTerm> tables;
  for (const auto& a : narrowed.added)
    if (a.empirical)
      tables.push_back(a);
    else
      base = without_effect(std::move(base), a.term.id);
  if (tables.empty() || tables.size() == narrowed.added.size()) return false;
  base.base_count = base.parameters.size();
  auto selection = s_.selection;
  selection.relative_remainder = 1 - selection.material_share;
  auto again = ask(base, false, carried_over(base, narrowed.hypothesis, narrowed.z),
                   {share_of_second_selection, share_of_second_selection}, selection);
  if (!is_named_beside_terms(again)) return false;
  const auto [before, after] = locked_excess(again);
  if (after > (1 - s_.selection.material_share) * before) return false;
  const double share = share_of_excess(again.base, again.best->fit, coarse_.samples());
  std::ranges::move(tables, std::back_inserter(terms_));
  tell_beside_terms(std::move(again), true, selection);
  if (found_.best->effects.size() == 1) {
    s_.out.added.back().share = share;
    if (before > 0) s_.out.added.back().share_held_out = 1 - after / before;
  }
  return true;
}

void Inquiry::tell_beside_terms(WorkflowResult again, bool named, const SelectionOptions& asked_by) {
  found_ = std::move(again);
  after_ = named ? found_.best->fit : found_.base;
  auto& out = s_.out;
  if (named) {
    out.not_testable = untestable_;
    summarize(found_, asked_by, out);
    compare_explanations();
  }
  estimate_terms(after_, after_.hypothesis, after_.z, s_.selection.likelihood_tempering, terms_);
  out.added.insert(out.added.begin(), terms_.begin(), terms_.end());
  out.recalibrated = recalibrations(after_, s_.selection);
  for (const auto& a : terms_)
    std::erase_if(out.recalibrated,
                  [&](const auto& r) { return r.first.starts_with("effects." + a.term.id + "."); });
  out.recalibrated_base = model_at(before_, "Recalibrated.");
  out.improved =
      model_at(after_, named ? "Recalibrated, with what was found missing and terms that have no name."
                             : gap_without_a_name);
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
  s_.tick("the proof", 0.95);
  auto& out = s_.out;
  std::set<std::size_t> unexplained_locked;
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
    const auto locked = locked_by(fine_.simulation()), locked_coarse = locked_by(coarse_.simulation());
    const auto locked_before = figures_before(locked, locked_coarse),
               locked_after = added ? predicted(locked, locked_coarse, after_) : locked_before;
    unexplained_locked = unexplained(locked, locked_before.standardized, s_.selection);
    out.held_out.before = rms_by_channel(locked, locked_before.standardized);
    out.held_out.after = rms_by_channel(locked, locked_after.standardized);
    out.share_held_out = share_explained(locked_before.standardized, locked_after.standardized);
    out.traces = traces(locked, locked_before, locked_after, 2, true);
  }
  // A term that was named alone by noise takes all that is taken; what each of two takes was not asked.
  if (!improved_ && out.added.size() == 1) {
    out.added.front().share = out.share;
    if (!s_.held_out.empty()) out.added.front().share_held_out = out.share_held_out;
  }
  tell_pasts(s_);
  for (auto& t : traces(fine_, before, after, 4, false)) out.traces.push_back(std::move(t));
  return unexplained_locked;
}

}  // namespace ferrobench::model::inference

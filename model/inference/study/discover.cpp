#include "model/inference/study/discover.h"

#include <algorithm>
#include <chrono>
#include <set>

#include "model/inference/dataset/held_out.h"
#include "model/inference/selection/candidates.h"
#include "model/inference/selection/experiment_design.h"
#include "model/inference/selection/leave_one_out.h"
#include "model/inference/selection/residual_basis.h"
#include "model/inference/solver/multifidelity.h"
#include "model/inference/study/improvement.h"
#include "model/inference/study/unknown_pasts.h"
#include "model/inference/study/validation.h"
#include "model/inference/study/workflow.h"
#include "recordings/analysis/skew.h"

namespace ferrobench::model {
namespace inference {
namespace {

// Rows of all recordings together: as many as say more than they cost.
constexpr std::size_t rows_together = 40000;
// The fine simulation begins with these nodes, and ends with so many as make its error unnoticeable.
constexpr SimulationOptions fine_simulation{.tolerance = 1e-5, .domains = 1000, .shift = 7};
constexpr int most_domains = 16000;

// Of the time, until effects are selected, where a gap is narrowed afterwards (measured: about half); and
// until the base is recalibrated. Where nothing is to be narrowed, progress ends with a leap.
constexpr double share_of_selection = 0.6, share_of_recalibration = 0.15;

using Clock = std::chrono::steady_clock;

struct Session {
  explicit Session(const DiscoverOptions& given) : options(given) {}
  const DiscoverOptions& options;
  Ticker tick = ticker(options);
  int threads = threads_of(options);
  Clock::time_point begin = Clock::now();
  Discovery out;
  bool presumed_past = true;        // of all that name none
  Eigen::VectorXd start;            // of the recalibration, where pasts were settled on; else empty
  std::vector<RecordingData> data;  // as a choice of pasts sees the recordings
  std::vector<BenchRecording> bench;
  std::vector<std::vector<NoiseModel>> noise;
  std::vector<std::size_t> train, held_out;
  SelectionOptions selection;  // the options', raised to what simulations resolve of what is learned from
  // What may be named, and what may stand for the rest: corrections of the kinetics, and tables.
  std::vector<const Effect*> candidates, corrections, tables;
};

// Takes out what these recordings can say nothing of.
void drop_untestable(Session& s) {
  if (std::ranges::any_of(s.bench, &BenchRecording::has_command)) return;
  const auto before_monitor = [](const Effect* e) { return acts_before_monitor(*e); };
  for (const auto* e : s.candidates)
    if (before_monitor(e)) s.out.not_testable.emplace_back(e->id);
  std::erase_if(s.candidates, before_monitor);
  std::erase_if(s.tables, before_monitor);
}

void choose_unknown_pasts(const Model& base, std::vector<NamedRecording>& recordings, Session& s) {
  for (const auto& r : recordings) s.data.push_back(prepare(r.recording));
  const auto pasts = likeliest_pasts_as_given(base, s.data, s.options);
  for (std::size_t i = 0; i < recordings.size(); ++i) {
    auto& past = recordings[i].recording.header.past;
    s.out.pasts.push_back({recordings[i].name, pasts[i], !past.known()});
    s.presumed_past = s.presumed_past && (past.known() || pasts[i].kind == protocols::PastKind::poled_plus);
    past = pasts[i];
  }
}

UnknownPasts unknown_pasts(Session& s) {
  std::vector<bool> unknown;
  for (const auto& p : s.out.pasts) unknown.push_back(p.chosen);
  const auto tick = [&s](const std::string& stage) { s.tick(stage, 0.01); };
  return {s.bench, s.noise, s.train, std::move(unknown), stoppable({}, s.options), s.threads, tick};
}

void tell_pasts(Session& s) {
  for (std::size_t i = 0; i < s.bench.size(); ++i) s.out.pasts[i].past = s.bench[i].header.past;
}

// What was chosen under the given model may have been wrong as that model was.
void settle_unknown_pasts(const Model& base, Session& s) {
  if (s.presumed_past) return;
  auto settled = settle_pasts(unknown_pasts(s), base_hypothesis(base, s.bench));
  s.presumed_past = settled.presumed;
  s.start = std::move(settled.z);
  tell_pasts(s);
}

// What narrowing a gap needs to know of this bench; `begun` of the whole is done before.
ImprovementTask improvement_task(Session& s, const SimulationOptions& fine, double begun) {
  return {
      .bench = &s.bench,
      .noise = &s.noise,
      .train = s.train,
      .held_out = s.held_out,
      .candidates = s.candidates,
      .corrections = s.corrections,
      .tables = s.tables,
      .simulation = fine,
      .threads = s.threads,
      .selection = s.selection,
      .floor = s.options.floor,
      .tick = [&s, begun](const std::string& stage, double f) { s.tick(stage, begun + (0.95 - begun) * f); }};
}

// A model that is wrong by much may have misled the choice of pasts, and be far from its best parameters.
void allow_far_search(Session& s, ImprovementTask& task) {
  task.presumed_past = s.presumed_past;
  task.search_bases = [&s, fine = task.simulation](const Model& base, const auto& effects, const auto& errors,
                                                   const auto& ticks) {
    return search_bases(base, effects, recordings_of_search(s.data, s.bench, errors, s.train),
                        {.seed = s.options.seed, .threads = s.threads, .simulation = fine, .tick = ticks});
  };
  if (std::ranges::none_of(s.out.pasts, &FittedPast::chosen)) return;
  task.choose_pasts = [&s](const Model& m) { return likeliest_pasts_over_range(m, s.data, s.options); };
  task.set_pasts = [&s](const std::vector<protocols::Past>& pasts) {
    hold_pasts(s.bench, pasts);
    tell_pasts(s);
  };
}

void split(Session& s, const std::vector<bool>& held) {
  s.train.clear();
  s.held_out.clear();
  for (std::size_t i = 0; i < s.bench.size(); ++i) {
    (held[i] ? s.held_out : s.train).push_back(i);
    (held[i] ? s.out.held_out : s.out.train).recordings.push_back(s.bench[i].name);
  }
  s.selection = s.options.selection;
  s.selection.raise_detection(squares_between_programs(s.bench, s.noise, s.train));
}

std::vector<bool> held_out_by(const Session& s) {
  const auto& wanted = s.options.held_out;
  if (wanted.empty()) return choose_held_out(s.bench);
  std::vector<std::string> names;
  for (const auto& r : s.bench) names.push_back(r.name);
  check_held_out(wanted, names);
  std::vector<bool> held;
  held.reserve(names.size());
  for (const auto& name : names) held.push_back(std::ranges::find(wanted, name) != wanted.end());
  return held;
}

std::string names_of(const Session& s, const std::set<std::size_t>& recordings) {
  std::string out;
  for (const auto i : recordings) out += (out.empty() ? "" : ", ") + s.bench[i].name;
  return out;
}

// Residual and slopes where a fit stands, by noise alone.
void stand_at(const WhitenedRecordings& residuals, Fit& fit) {
  fit.fidelity_correction.resize(0);
  fit.residual = residuals.evaluate(fit.hypothesis, fit.z);
  fit.squares = fit.residual.squaredNorm() + prior_squares(fit.hypothesis, fit.z);
  refresh_jacobian(residuals, fit);
}

// The workflow for one choice of what is held out: the answer by noise, a better model where that leaves
// more, and the proof.
class Inquiry {
 public:
  Inquiry(Session& session, const Model& base)
      : s_(session),
        base_(base_hypothesis(base, s_.bench)),
        coarse_(s_.bench, s_.noise, s_.train, stoppable({}, s_.options), s_.threads),
        fine_(s_.bench, s_.noise, s_.train, fine_for(base), s_.threads) {}

  // Fills in the session's Discovery. Returns the held-out recordings that the recalibrated base does not
  // explain.
  std::set<std::size_t> run() {
    s_.tick("choosing how finely to simulate", 0.01);
    const double error = choose_fidelities(coarse_, fine_, base_, prior_mean(base_), most_domains);
    s_.out.health.numerical_error_over_noise = error;
    s_.selection.raise_detection(error * error * fine_.samples());
    found_ = ask(true, s_.start);
    if (found_.gross) improve_gross();
    summarize(found_, s_.selection, s_.out);
    before_ = found_.base;
    after_ = found_.after();
    if (!found_.gross) compare_explanations();
    if (!found_.gross) improve_beyond_effects();
    if (improved_) tell_improvement();
    if (s_.out.verdict == Verdict::unknown) tell_where();
    return prove();
  }

 private:
  SimulationOptions fine_for(const Model& base) const {
    auto out = stoppable(fine_simulation, s_.options);
    out.every_spread = adds_a_spread(base, s_.candidates);
    return out;
  }

  // With what was learned of the fidelities so far. Recalibrates from `start`, or from the given values.
  WorkflowResult ask(bool unless_gross, Eigen::VectorXd start) {
    return run_workflow(
        coarse_, fine_, base_,
        {.candidates = s_.candidates,
         .seed = s_.options.seed,
         .start = std::move(start),
         .most_domains = most_domains,
         .selection = s_.selection,
         .roughly_fitted =
             [this](const Fit& f) {
               coarse_.marginalize_drive(f.hypothesis, f.z);
               fine_.marginalize_as(coarse_);
             },
         .is_gross = [this, unless_gross](
                         const Fit& f) { return unless_gross && is_gross(coarse_, f.hypothesis, f.z); },
         .beyond_effects = [this](const Fit& f) { return fit_residual_basis(coarse_, f).beyond_chance; },
         .tick = [this](const std::string& stage, double f) { s_.tick(stage, share_of_selection * f); }},
        s_.out.health);
  }

  void improve_gross() {
    Fit given;
    given.hypothesis = base_;
    given.z = prior_mean(base_);
    auto task = improvement_task(s_, fine_.simulation(), share_of_recalibration);
    allow_far_search(s_, task);
    improved_ = improve(given, task, s_.out.health.warnings);
    if (!improved_ || is_gross(coarse_, improved_->hypothesis, improved_->z)) return;
    // A large effect, or a valley that noise alone did not lead out of: then noise is the measure after all.
    const bool base_alone = improved_->added.empty();
    if (!base_alone && std::ranges::all_of(improved_->added, &AddedTerm::empirical)) return;
    auto again =
        ask(false, base_alone ? carried_over(base_, improved_->hypothesis, improved_->z) : Eigen::VectorXd{});
    if (again.best == nullptr && !base_alone) return;
    found_ = std::move(again);
    improved_.reset();
  }

  // How each explanation does on every recording in turn, and the experiment that would tell two apart.
  void compare_explanations() {
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
  void improve_beyond_effects() {
    if (s_.out.verdict == Verdict::nothing_missing || found_.selection.sufficient ||
        !is_material(fine_, after_.hypothesis, after_.z, s_.options.floor))
      return;
    auto task = improvement_task(s_, fine_.simulation(), share_of_selection);
    task.named = s_.out.added;
    if (task.named.empty()) task.by_noise = &coarse_;
    auto improved = improve(after_, task, s_.out.health.warnings);
    if (improved && improved->added.size() > task.named.size()) improved_ = std::move(improved);
  }

  void tell_improvement() {
    auto& out = s_.out;
    after_.hypothesis = improved_->hypothesis;
    after_.z = improved_->z;
    stand_at(coarse_, after_);
    out.added = improved_->added;
    if (found_.gross) {
      before_ = std::move(improved_->base);
      out.recalibrated = recalibrations(before_, s_.selection);
      out.recalibrated_base = model_at(before_, "Recalibrated beside its own error.");
      stand_at(coarse_, before_);
      if (improved_->named) summarize_named(*improved_, s_.selection, out);
    }
    if (improved_->searched)
      out.health.warnings.emplace_back("The whole range of the base model's parameters was searched again.");
    const bool empirical = std::ranges::any_of(out.added, &AddedTerm::empirical);
    out.improved =
        model_at(after_, !improved_->named ? "Recalibrated, with terms that narrow a gap that has no name."
                         : empirical ? "Recalibrated, with what was found missing, and tables for the rest."
                                     : "Recalibrated, with what was found missing.");
  }

  void tell_where() {
    const auto explained = fit_residual_basis(coarse_, before_);
    s_.out.family = explained.family;
    // So far off, plain functions of the signals would have to be of any size.
    if (!found_.gross) s_.out.signals = reconstruct_signals(coarse_, before_, explained);
  }

  std::set<std::size_t> prove() {
    s_.tick("the proof", 0.95);
    auto& out = s_.out;
    std::set<std::size_t> unexplained_locked;
    const bool added = !out.added.empty();
    const auto figures = [this](const WhitenedRecordings& of, const WhitenedRecordings& by, const Fit& f) {
      refine_pasts(unknown_pasts(s_), f.hypothesis, f.z);
      return found_.gross ? predict(of, f.hypothesis, f.z) : predict(of, by, f.hypothesis, f.z);
    };
    const auto before = figures(fine_, coarse_, before_),
               after = added ? figures(fine_, coarse_, after_) : before;
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
      const WhitenedRecordings locked(s_.bench, s_.noise, s_.held_out, fine_.simulation(), s_.threads);
      const WhitenedRecordings locked_coarse(s_.bench, s_.noise, s_.held_out, coarse_.simulation(),
                                             s_.threads);
      const auto locked_before = figures(locked, locked_coarse, before_),
                 locked_after = added ? figures(locked, locked_coarse, after_) : locked_before;
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
    out.health.simulations += coarse_.simulations();
    return unexplained_locked;
  }

  Session& s_;
  Hypothesis base_;
  WhitenedRecordings coarse_, fine_;
  WorkflowResult found_;
  std::optional<Improvement> improved_;
  Fit before_, after_;  // the recalibrated base, and with what is added
};

}  // namespace
}  // namespace inference

Discovery discover(const Model& base, std::vector<NamedRecording> recordings,
                   const DiscoverOptions& options) {
  using namespace inference;
  check_selection(options.selection);
  check_floor(options.floor);
  Session s(options);
  s.tick("reading the recordings", 0);
  s.candidates = candidates_of(base, options.candidates);
  for (const auto* term : empirical_terms(base)) (term->table ? s.tables : s.corrections).push_back(term);
  check_recordings(recordings);
  s.out.asked = asked_of(base, options);
  for (auto& r : recordings) {
    const auto& h = r.recording.header;
    s.out.asked.sources.push_back({r.name, h.title, h.entry_identifier, h.start_time});
    ferrobench::recordings::remove_skew(r.recording);
  }
  s.tick("choosing the specimen's past", 0.005);
  choose_unknown_pasts(base, recordings, s);
  s.bench =
      prepare_bench(base, recordings, rows_together, s.out.health.warnings, stoppable({}, options).stop);
  recordings.clear();
  s.noise = estimate_noise(s.bench, s.out.health.warnings);
  summarize_noise(s.bench, s.noise, s.out.health);
  drop_untestable(s);
  const auto as_read = s.out;
  split(s, held_out_by(s));
  settle_unknown_pasts(base, s);
  auto unexplained_locked = Inquiry(s, base).run();
  if (s.out.verdict == Verdict::nothing_missing && !unexplained_locked.empty() && options.held_out.empty()) {
    // What is missing shows in those alone, so they are learned from, and others are held out.
    const int simulations = s.out.health.simulations;
    s.out = as_read;
    s.out.health.simulations = simulations;
    s.out.health.warnings.push_back("What the others do not show was found in " +
                                    names_of(s, unexplained_locked) +
                                    ", locked away at first: learned from, and others locked away instead.");
    const auto tick = s.tick;
    s.tick = [tick](const std::string& stage, double f) { tick(stage, 0.95 + 0.05 * f); };
    split(s, choose_held_out(s.bench, unexplained_locked));
    unexplained_locked = Inquiry(s, base).run();
  }
  auto& out = s.out;
  if (out.verdict == Verdict::nothing_missing && !unexplained_locked.empty())
    out.health.warnings.push_back("What was locked away is not explained in " +
                                  names_of(s, unexplained_locked) +
                                  ": something may be missing that shows only there.");
  out.health.seconds = std::chrono::duration<double>(Clock::now() - s.begin).count();
  s.tick("done", 1);
  return std::move(s.out);
}

}  // namespace ferrobench::model

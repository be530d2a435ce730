#include "model/inference/study/discover.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <set>

#include "model/inference/dataset/held_out.h"
#include "model/inference/selection/candidates.h"
#include "model/inference/selection/experiment_design.h"
#include "model/inference/selection/leave_one_out.h"
#include "model/inference/selection/residual_basis.h"
#include "model/inference/solver/multifidelity.h"
#include "model/inference/study/improvement.h"
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

// A choice of pasts simulates by so many domains at this tolerance, as the starts of a fit do (study/fit.h).
constexpr SimulationOptions for_pasts{.tolerance = 1e-3, .domains = 128};

using Clock = std::chrono::steady_clock;

struct Session {
  explicit Session(const DiscoverOptions& given) : options(given) {}
  const DiscoverOptions& options;
  Ticker tick = ticker(options);
  int threads = threads_of(options);
  Clock::time_point begin = Clock::now();
  Discovery out;
  bool presumed_past = true;        // of all that name none
  std::vector<RecordingData> data;  // as a choice of pasts sees the recordings
  std::vector<BenchRecording> bench;
  std::vector<std::vector<NoiseModel>> noise;
  std::vector<std::size_t> train, held_out;
};

// Recordings that name no past get the likeliest one under the model. Poled towards + is presumed, as the
// simulator does.
void choose_unknown_pasts(const Model& base, std::vector<NamedRecording>& recordings, Session& s) {
  for (const auto& r : recordings) s.data.push_back(prepare(r.recording));
  const auto pasts =
      choose_pasts({&base, 1}, s.data,
                   {.fidelity = {.simulation = stoppable(for_pasts, s.options), .coarse = true},
                    .heights_are_free = true,
                    .presumed = protocols::Past{protocols::PastKind::poled_plus}});
  for (std::size_t i = 0; i < recordings.size(); ++i) {
    auto& past = recordings[i].recording.header.past;
    s.out.pasts.push_back({recordings[i].name, pasts[i], !past.known()});
    s.presumed_past = s.presumed_past && (past.known() || pasts[i].kind == protocols::PastKind::poled_plus);
    past = pasts[i];
  }
}

// The likeliest ones under a model that was recalibrated.
std::vector<protocols::Past> choose_pasts_again(const Model& model, const Session& s) {
  // At a partial reversal fewer domains than these tell one past from another by the grain of their own sum.
  constexpr SimulationOptions by{.tolerance = 1e-4, .domains = 500};
  return choose_pasts({&model, 1}, s.data,
                      {.fidelity = {.simulation = stoppable(by, s.options), .coarse = true}});
}

void set_pasts(Session& s, const std::vector<protocols::Past>& pasts) {
  for (std::size_t i = 0; i < s.bench.size(); ++i)
    if (s.out.pasts[i].chosen) s.bench[i].header.past = s.out.pasts[i].past = pasts[i];
}

// What narrowing a gap needs to know of this bench.
ImprovementTask improvement_task(Session& s, const std::vector<const Effect*>& candidates,
                                 const SimulationOptions& fine) {
  ImprovementTask out{.bench = &s.bench,
                      .noise = &s.noise,
                      .train = s.train,
                      .held_out = s.held_out,
                      .candidates = candidates,
                      .simulation = fine,
                      .threads = s.threads,
                      .selection = s.options.selection,
                      .floor = s.options.floor,
                      .tick = [&s](const std::string& stage, double f) { s.tick(stage, 0.9 + 0.05 * f); }};
  if (s.presumed_past) return out;
  out.choose_pasts = [&s](const Model& m) { return choose_pasts_again(m, s); };
  out.set_pasts = [&s](const std::vector<protocols::Past>& pasts) { set_pasts(s, pasts); };
  return out;
}

// Where most is left in the channel whose model error is largest over its range, if that is material.
std::optional<Remainder> remainder_of(const Session& s, const WhitenedRecordings& coarse, const Fit& fit,
                                      const std::vector<Excess>& where) {
  const auto worst =
      std::ranges::max_element(s.out.left, {}, [](const auto& l) { return l.second.model_error; });
  if (worst == s.out.left.end() || worst->second.model_error <= s.options.floor) return std::nullopt;
  const auto place = std::ranges::find(where, worst->first, &Excess::channel);  // sorted, worst first
  return Remainder{.family = fit_residual_basis(coarse, fit).family,
                   .channel = worst->first,
                   .segment = place == where.end() ? "" : place->segment,
                   .of_range = worst->second.model_error};
}

void split(Session& s, const std::vector<bool>& held) {
  s.train.clear();
  s.held_out.clear();
  for (std::size_t i = 0; i < s.bench.size(); ++i) {
    (held[i] ? s.held_out : s.train).push_back(i);
    (held[i] ? s.out.held_out : s.out.train).recordings.push_back(s.bench[i].name);
  }
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

LeaveOneOut leave_one_out(const WhitenedRecordings& coarse, const std::vector<double>& base,
                          const Fit& with) {
  LeaveOneOut out{.recordings = base.size()};
  const auto squares = leave_one_out_squares(coarse, with);
  for (std::size_t i = 0; i < base.size(); ++i) {
    out.gain += base[i] - squares[i];
    out.better += squares[i] < base[i] ? 1 : 0;
  }
  return out;
}

std::map<recordings::Channel, Left> left_at(const WhitenedRecordings& residuals, const Hypothesis& hypothesis,
                                            const Eigen::VectorXd& z) {
  return left_by_channel(residuals, predict(residuals, hypothesis, z).standardized);
}

// Whether the model is so far off that its own error, and not noise, is what effects have to be told from: in
// a channel more than ten times the noise and 2 % of the range. Of twelve benches of the campaign whose
// physics is the model's recalibration left at most 5.1 times the noise; one large effect can leave more.
bool is_gross(const WhitenedRecordings& residuals, const Hypothesis& hypothesis, const Eigen::VectorXd& z) {
  constexpr double over_noise = 10, of_range = 0.02;
  return std::ranges::any_of(left_at(residuals, hypothesis, z), [](const auto& l) {
    return l.second.over_noise > over_noise && l.second.of_range > of_range;
  });
}

// Whether the model's own error is more than this share of a channel's range anywhere.
bool is_material(const WhitenedRecordings& residuals, const Fit& fit, double floor) {
  return std::ranges::any_of(left_at(residuals, fit.hypothesis, fit.z),
                             [&](const auto& l) { return l.second.model_error > floor; });
}

// Verdict and explanations where effects were named beside the model's own error.
void tell_named(const Improvement& found, const SelectionOptions& options, Discovery& out) {
  double share = 1;
  Explanation named;
  for (const auto& a : found.added) {
    share = std::min({share, a.share.value_or(1), a.share_held_out.value_or(1)});
    named.effects.push_back(a.term);
  }
  out.probability_unknown = probability_of_unknown(share, options);
  out.probability_nothing = 0;
  out.explanations.clear();
  for (const auto& [effect, probability] : found.rivals) {
    auto rival = named;
    if (effect->id != named.effects.back().id)
      rival.effects.back() = {.id = std::string(effect->id), .parameters = {}};
    rival.probability = probability * (1 - out.probability_unknown);
    if (probability > options.least_probability) out.explanations.push_back(std::move(rival));
  }
  const bool first = found.rivals.front().first->id == named.effects.back().id;
  out.verdict =
      first && found.rivals.front().second > options.confident ? Verdict::named : Verdict::ambiguous;
  out.family = find_effect(named.effects.front().id).family;
}

// Residual and slopes where a fit stands, by noise alone.
void stand_at(const WhitenedRecordings& residuals, Fit& fit) {
  fit.fidelity_correction.resize(0);
  fit.residual = residuals.evaluate(fit.hypothesis, fit.z);
  fit.squares = fit.residual.squaredNorm() + prior_squares(fit.hypothesis, fit.z);
  refresh_jacobian(residuals, fit);
}

// The workflow for one choice of what is held out. Returns the held-out recordings that the recalibrated base
// does not explain.
std::set<std::size_t> train_and_validate(Session& s, const Model& base,
                                         const std::vector<const Effect*>& candidates) {
  const auto hypothesis = base_hypothesis(base, s.bench);
  auto fine_options = stoppable(fine_simulation, s.options);
  fine_options.every_spread = adds_a_spread(base, candidates);
  WhitenedRecordings coarse(s.bench, s.noise, s.train, stoppable({}, s.options), s.threads);
  WhitenedRecordings fine(s.bench, s.noise, s.train, fine_options, s.threads);
  s.tick("choosing how finely to simulate", 0.01);
  s.out.health.numerical_error_over_noise = choose_fidelities(coarse, fine, hypothesis, most_domains);
  // Asked with what was learned of it so far.
  const auto ask = [&](bool unless_gross) {
    return run_workflow(
        coarse, fine, hypothesis,
        {.candidates = candidates,
         .seed = s.options.seed,
         .most_domains = most_domains,
         .selection = s.options.selection,
         .roughly_fitted =
             [&](const Fit& f) {
               coarse.marginalize_drive(f.hypothesis, f.z);
               fine.marginalize_as(coarse);
             },
         .is_gross =
             [&, unless_gross](const Fit& f) { return unless_gross && is_gross(coarse, f.hypothesis, f.z); },
         .beyond_effects = [&](const Fit& f) { return fit_residual_basis(coarse, f).beyond_chance; },
         .tick = s.tick},
        s.out.health);
  };
  auto found = ask(true);
  std::optional<Improvement> narrowed;
  if (found.gross) {
    narrowed =
        improve(hypothesis, prior_mean(hypothesis), improvement_task(s, candidates, fine.simulation()));
    // Was it one large effect, and no physics that is off? Then noise alone is the measure after all.
    if (narrowed->named && !is_gross(coarse, narrowed->hypothesis, narrowed->z))
      if (auto again = ask(false); again.best != nullptr) {
        found = std::move(again);
        narrowed.reset();
      }
  }
  auto& out = s.out;
  summarize(found, s.options.selection, out);
  Fit fitted = found.base, after = found.after();
  if (s.train.size() > 1 && !out.explanations.empty()) {
    const auto without = leave_one_out_squares(coarse, fitted);
    for (std::size_t i = 0; i < out.explanations.size(); ++i)
      out.explanations[i].leave_one_out =
          leave_one_out(coarse, without, found.selection.trials[i].first->fit);
  }
  if (const auto& rivals = found.selection.trials; out.verdict == Verdict::ambiguous && rivals.size() > 1) {
    s.tick("looking for the experiment that would decide", 0.91);
    out.next_experiment =
        choose_experiment(coarse, s.noise, rivals[0].first->fit, rivals[1].first->fit, s.options.selection);
  }
  if (!found.gross && out.verdict == Verdict::unknown && is_material(fine, fitted, s.options.floor))
    narrowed = improve(hypothesis, fitted.z, improvement_task(s, candidates, fine.simulation()));
  if (narrowed) {
    if (found.gross || !narrowed->added.empty()) {
      after.hypothesis = narrowed->hypothesis;
      after.z = narrowed->z;
      stand_at(coarse, after);
    }
    out.added = narrowed->added;
    if (found.gross) {
      fitted = std::move(narrowed->base);
      out.recalibrated = recalibrations(fitted, s.options.selection);
      out.recalibrated_base = model_at(fitted, "Recalibrated beside its own error.");
      stand_at(coarse, fitted);
    }
    if (narrowed->named) tell_named(*narrowed, s.options.selection, out);
    out.improved =
        model_at(after, narrowed->named ? "Recalibrated, with what was found missing."
                                        : "Recalibrated, with terms that narrow a gap that has no name.");
  }
  if (out.verdict == Verdict::unknown) {
    const auto explained = fit_residual_basis(coarse, fitted);
    out.family = explained.family;
    // So far off, plain functions of the signals would have to be of any size.
    if (!found.gross) out.signals = reconstruct_signals(coarse, fitted, explained);
  }
  s.tick("the proof", 0.95);
  std::set<std::size_t> unexplained_locked;
  const bool added = !out.added.empty();
  const auto figures = [&](const WhitenedRecordings& of, const WhitenedRecordings& by, const Fit& f) {
    return found.gross ? predict(of, f.hypothesis, f.z) : predict(of, by, f);
  };
  const auto before_it = figures(fine, coarse, fitted),
             after_it = added ? figures(fine, coarse, after) : before_it;
  out.where = excess_by_segment_class(fine, before_it.standardized);
  out.train.before = rms_by_channel(fine, before_it.standardized);
  out.train.after = rms_by_channel(fine, after_it.standardized);
  out.share = share_explained(before_it.standardized, after_it.standardized);
  out.left = left_by_channel(fine, after_it.standardized);
  out.remainder = remainder_of(s, coarse, after, excess_by_segment_class(fine, after_it.standardized));
  if (!s.held_out.empty()) {
    const WhitenedRecordings locked(s.bench, s.noise, s.held_out, fine.simulation(), s.threads);
    const WhitenedRecordings locked_coarse(s.bench, s.noise, s.held_out, coarse.simulation(), s.threads);
    const auto locked_before = figures(locked, locked_coarse, fitted),
               locked_after = added ? figures(locked, locked_coarse, after) : locked_before;
    unexplained_locked = unexplained(locked, locked_before.standardized, s.options.selection);
    out.held_out.before = rms_by_channel(locked, locked_before.standardized);
    out.held_out.after = rms_by_channel(locked, locked_after.standardized);
    out.share_held_out = share_explained(locked_before.standardized, locked_after.standardized);
    out.traces = traces(locked, locked_before, locked_after, 2, true);
  }
  // A term that was named alone by noise takes all that is taken; what each of two takes was not asked.
  if (!narrowed && out.added.size() == 1) {
    out.added.front().share = out.share;
    if (!s.held_out.empty()) out.added.front().share_held_out = out.share_held_out;
  }
  for (auto& t : traces(fine, before_it, after_it, 4, false)) out.traces.push_back(std::move(t));
  out.health.simulations += coarse.simulations();
  return unexplained_locked;
}

}  // namespace
}  // namespace inference

Discovery discover(const Model& base, std::vector<NamedRecording> recordings,
                   const DiscoverOptions& options) {
  using namespace inference;
  check_selection(options.selection);
  check_floor(options.floor);
  Session s(options);
  s.tick("reading the recordings", 0);
  const auto candidates = candidates_of(base, options.candidates);
  check_recordings(recordings);
  for (auto& r : recordings) ferrobench::recordings::remove_skew(r.recording);
  s.tick("choosing the specimen's past", 0.005);
  choose_unknown_pasts(base, recordings, s);
  s.bench =
      prepare_bench(base, recordings, rows_together, s.out.health.warnings, stoppable({}, options).stop);
  recordings.clear();
  s.noise = estimate_noise(s.bench, s.out.health.warnings);
  for (std::size_t r = 0; r < s.bench.size(); ++r)
    for (std::size_t c = 0; c < s.bench[r].channels.size(); ++c) {
      auto& n = s.out.health.noise[s.bench[r].channels[c].channel];
      if (s.noise[r][c].std() > n.std)
        n = {s.noise[r][c].std(), s.noise[r][c].slow > 0, s.noise[r][c].correlation_time};
    }

  const auto as_read = s.out;
  split(s, held_out_by(s));
  auto unexplained_locked = train_and_validate(s, base, candidates);
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
    unexplained_locked = train_and_validate(s, base, candidates);
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

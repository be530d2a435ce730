#include "model/inference/study/workflow.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <mutex>
#include <thread>
#include <tuple>

#include "model/inference/parameters/parameters.h"
#include "model/inference/search/multistart.h"
#include "model/inference/selection/forward_selection.h"
#include "model/inference/solver/covariance.h"
#include "model/inference/solver/multifidelity.h"
#include "recordings/format/iso_time.h"

namespace ferrobench::model::inference {
namespace {

// The simulations' own error, in standard deviations of the noise, that a report warns of.
constexpr double noticeable_error = 0.05;

// A base fit that leaves more than this is not taken to its end at first (SelectionOptions::unfinished_base).
double rejected_above(double samples, const SelectionOptions& options) {
  return samples + std::max(options.unfinished_base * options.detection, options.noise_uncertainty * samples);
}

void detectable(Discovery& out, const WorkflowResult& s, const SelectionOptions& options) {
  for (const auto& c : s.forward.screened) {
    const bool named = std::ranges::any_of(out.explanations, [&](const Explanation& e) {
      return std::ranges::any_of(e.effects,
                                 [&](const auto& estimate) { return estimate.id == c.effect->id; });
    });
    if (c.excited < options.testable && !named) {
      out.not_testable.emplace_back(c.effect->id);
      continue;
    }
    if (c.across <= 0) continue;
    const auto& p = c.effect->parameters.front();
    const Amplitude amplitude(p);
    out.smallest_detectable[std::string(c.effect->id)][std::string(p.name)] = amplitude.value(
        c.strength * std::sqrt((options.detection + bic_penalty({c.effect}, s.samples)) / c.across));
  }
}

// Explanations that these recordings cannot tell apart.
void equivalences(Discovery& out, const ForwardSelection& forward, double samples,
                  const SelectionOptions& options) {
  if (forward.trials.empty()) return;
  const auto& best = forward.trials.front();
  std::vector<std::string> group;
  for (const auto& t : forward.trials)
    if (t.effects.size() == 1 && best.effects.size() == 1 &&
        delta_bic(t, samples) > delta_bic(best, samples) - options.equivalent)
      group.emplace_back(t.effects[0]->id);
  if (group.size() > 1) out.equivalent.emplace_back(std::move(group));
}

}  // namespace

std::map<std::string, Recalibration> recalibrations(const Fit& fit, const SelectionOptions& options) {
  const Eigen::MatrixXd covariance = robust_covariance(fit, options.likelihood_tempering);
  std::map<std::string, Recalibration> out;
  for (std::size_t i = 0; i < fit.hypothesis.base_count; ++i) {
    const auto& c = fit.hypothesis.parameters[i];
    const auto k = static_cast<Eigen::Index>(i);
    out[c.path] = {c.from, c.value(fit.z[k]),
                   std::abs(c.slope(fit.z[k])) * std::sqrt(std::max(0.0, covariance(k, k))), fit.z[k]};
  }
  return out;
}

Asked asked_of(const Model& base, const DiscoverOptions& options) {
  return {.model = base,
          .sources = {},
          .held_out = options.held_out,
          .candidates = options.candidates,
          .floor = options.floor,
          .seed = options.seed,
          .time = recordings::iso_now()};
}

Model model_at(const Fit& fit, const std::string& note) {
  auto out = setting_at(fit.hypothesis, fit.z).model;
  out.notes += (out.notes.empty() ? "" : " ") + note;
  return out;
}

void estimate_terms(const Fit& fit, const Hypothesis& hypothesis, const Eigen::VectorXd& z, double tempering,
                    std::vector<AddedTerm>& added) {
  const Eigen::MatrixXd covariance = robust_covariance(fit, tempering);
  const auto& moved = hypothesis.parameters;
  const auto model = setting_at(hypothesis, z).model;
  for (auto& a : added) {
    a.term.parameters.clear();
    for (const auto& p : find_effect(a.term.id).parameters) {
      const auto path = effect_path(a.term.id, p.name);
      const double value = get_parameter(model, path);
      EffectEstimate::Parameter told{std::string(p.name), value, value, value};
      const auto c = std::ranges::find(moved, path, &ScaledParameter::path);
      if (c != moved.end()) {
        const auto k = static_cast<Eigen::Index>(c - moved.begin());
        const double reach = interval_90 * std::sqrt(std::max(0.0, covariance(k, k)));
        std::tie(told.low, told.high) = std::minmax<double>(
            {c->value(std::max(c->low, z[k] - reach)), c->value(std::min(c->high, z[k] + reach))});
      }
      a.term.parameters.push_back(std::move(told));
    }
  }
}

int threads_of(const DiscoverOptions& options) {
  return options.threads > 0 ? options.threads
                             : static_cast<int>(std::max(1U, std::thread::hardware_concurrency()));
}

SimulationOptions watched(SimulationOptions simulation, const DiscoverOptions& options,
                          std::atomic<std::uint64_t>& begun) {
  if (options.stop) simulation.stop = &options.stop;
  simulation.begun = &begun;
  return simulation;
}

Ticker ticker(const DiscoverOptions& options) {
  struct Asked {
    std::mutex mutex;
    bool stopped = false;  // once said, it is not asked again by other threads
    double fraction = 0;   // told so far: what is asked again goes on from there
  };
  return [&options, asked = std::make_shared<Asked>()](const std::string& stage, double fraction) {
    const std::scoped_lock lock(asked->mutex);
    asked->fraction = std::max(asked->fraction, fraction);
    asked->stopped = asked->stopped || (options.progress && !options.progress({stage, asked->fraction}));
    if (asked->stopped) throw Error(ErrorCode::cancelled, "the search was stopped");
  };
}

void check_held_out(const std::vector<std::string>& wanted, const std::vector<std::string>& names) {
  for (const auto& name : wanted)
    if (std::ranges::find(names, name) == names.end())
      throw Error(
          ErrorCode::invalid_params, "\"" + name + "\" cannot be held out",
          Problem{.path = "/held_out", .message = "is not among them", .given = name, .allowed = names});
  if (std::ranges::all_of(names, [&](const auto& n) { return std::ranges::find(wanted, n) != wanted.end(); }))
    throw Error(ErrorCode::invalid_params, "everything is held out: there is nothing to learn from");
}

void check_selection(const SelectionOptions& options) {
  std::string problem;
  if (!options.is_valid(&problem))
    throw Error(ErrorCode::invalid_params, "the thresholds of the selection make no sense",
                Problem{.path = "/selection", .message = problem});
}

void check_floor(double floor) {
  if (!(floor > 0 && floor < 1))
    throw Error(ErrorCode::invalid_params, "the floor is no share of a range",
                Problem{.path = "/floor",
                        .message = "must be above 0 and below 1",
                        .given = floor,
                        .hint = "0.002 is 0.2 % of a channel's range"});
}

void summarize_noise(const std::vector<BenchRecording>& bench,
                     const std::vector<std::vector<NoiseModel>>& noise, Health& health) {
  for (std::size_t r = 0; r < bench.size(); ++r)
    for (std::size_t c = 0; c < bench[r].channels.size(); ++c) {
      auto& n = health.noise[bench[r].channels[c].channel];
      if (noise[r][c].std() > n.std)
        n = {noise[r][c].std(), noise[r][c].slow > 0, noise[r][c].correlation_time};
    }
}

WorkflowResult run_workflow(const WhitenedResiduals& coarse, WhitenedResiduals& fine, const Hypothesis& base,
                            const WorkflowOptions& options, Health& health) {
  const auto& selection = options.selection;
  WorkflowResult out;
  out.samples = coarse.samples();
  auto recalibrated = fit_base(coarse, fine, base,
                               {.seed = options.seed,
                                .start = options.start,
                                .roughly_fitted = options.roughly_fitted,
                                .is_enough = options.is_gross,
                                .rejected = rejected_above(coarse.samples(), selection),
                                .tick = options.tick});
  health.starts = recalibrated.starts;
  health.start_spread = recalibrated.spread;
  out.base = std::move(recalibrated.fit);
  if (recalibrated.ended) {
    out.gross = true;
    out.selection.verdict = Verdict::unknown;
    out.selection.probability_unknown = 1;
    return out;
  }
  bool is_final = recalibrated.is_final;
  const auto end_base = [&] {
    const auto tick = [&] { options.tick("recalibrating the model to the end", 0.27); };
    anchor_corrected(coarse, fine, out.base, tick);
    refine_around_anchor(coarse, fine, out.base, tick);
    is_final = true;
  };
  double begun = 0.3;
  std::vector<Trial> known;  // of the searches before, one of which may have ended before it tried them
  for (std::size_t again = 0; again <= selection.base_restarts;) {
    if (!out.forward.trials.empty()) known = std::move(out.forward.trials);
    out.forward = select_forward(
        coarse, fine, out.base,
        {.candidates = options.candidates,
         .known = known,
         .most_domains = options.most_domains,
         .doubt_base = again < selection.base_restarts,
         .base_is_final = is_final,
         .beyond_effects = options.beyond_effects,
         .tick = [&](const std::string& stage, double f) { options.tick(stage, begun + (0.9 - begun) * f); }},
        selection);
    if (out.forward.base_decides) {
      end_base();
      continue;
    }
    if (!out.forward.better_base) break;
    out.base = *std::move(out.forward.better_base);
    begun += 0.5 * (0.9 - begun);
    ++again;
  }
  out.selection = select_model(out.forward, selection, out.samples);
  const auto verdict = out.selection.verdict;
  if (verdict == Verdict::named || verdict == Verdict::ambiguous)
    out.best = out.selection.trials.front().first;
  else if (!is_final)
    end_base();
  fine.release();
  for (const auto& [trial, probability] : out.selection.trials)
    health.numerical_error_over_noise = std::max(health.numerical_error_over_noise, trial->numerical_error);
  if (health.numerical_error_over_noise > noticeable_error)
    health.warnings.emplace_back(
        "The noise is so low that the simulations' own error shows in the residuals.");
  return out;
}

void summarize(const WorkflowResult& found, const SelectionOptions& options, Discovery& out) {
  // Of another answer, whose place this one takes, nothing stays.
  out.explanations.clear();
  out.doubted.clear();
  out.added.clear();
  out.smallest_detectable.clear();
  out.equivalent.clear();
  out.verdict = found.selection.verdict;
  out.probability_unknown = found.selection.probability_unknown;
  out.probability_nothing = found.selection.probability_nothing;
  if (out.verdict != Verdict::nothing_missing)
    for (const auto& [trial, probability] : found.selection.trials)
      out.explanations.push_back({effect_estimates(*trial, options), probability, {}});
  if (out.verdict == Verdict::unknown && found.selection.doubted != nullptr)
    out.doubted = effect_estimates(*found.selection.doubted, options);
  if (found.best != nullptr) {
    for (const auto& e : out.explanations.front().effects) out.added.push_back({.term = e});
    out.family = found.best->effects.front()->family;
  }
  out.recalibrated = recalibrations(found.after(), options);
  out.recalibrated_base = model_at(found.base, "Recalibrated.");
  out.improved = found.best != nullptr
                     ? model_at(found.best->fit, "Recalibrated, with what was found missing.")
                     : out.recalibrated_base;
  detectable(out, found, options);
  equivalences(out, found.forward, found.samples, options);
  for (const auto& t : found.forward.trials) {
    if (!t.checked || (found.best != nullptr && &t != found.best)) continue;
    out.health.largest_left = t.left;
    out.health.allowed_left = allowed_remainder(options, t.drop);
    break;
  }
}

void summarize_named(const Improvement& found, const SelectionOptions& options, Discovery& out) {
  double share = 1;
  Explanation named;
  for (const auto& a : found.added) {
    if (a.empirical) continue;
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

}  // namespace ferrobench::model::inference

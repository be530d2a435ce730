#include "model/discrepancy/discover.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <random>
#include <thread>

#include "model/discrepancy/experiment.h"
#include "model/discrepancy/proof.h"
#include "model/discrepancy/report.h"
#include "model/discrepancy/signals.h"
#include "model/discrepancy/verdict.h"

namespace ferrobench::model {

using namespace discrepancy;

std::span<const std::pair<Verdict, std::string_view>> enum_names(Verdict) {
  static constexpr std::array<std::pair<Verdict, std::string_view>, 4> names{
      {{Verdict::named, "named"},
       {Verdict::ambiguous, "ambiguous"},
       {Verdict::unknown, "unknown"},
       {Verdict::nothing_missing, "nothing_missing"}}};
  return names;
}

namespace {

constexpr std::size_t rows_together = 40000;
constexpr int base_starts = 5;

using Clock = std::chrono::steady_clock;

struct Session {
  explicit Session(const DiscoverOptions& given) : options(given) {}
  const DiscoverOptions& options;
  Clock::time_point begin = Clock::now();
  Discovery out;
  std::vector<BenchRecording> bench;
  std::vector<std::vector<NoiseModel>> noise;
  std::vector<std::size_t> train, held_out;
  int threads = 1;

  void tick(const std::string& stage, double fraction) const {
    if (options.progress && !options.progress({stage, fraction}))
      throw Error(ErrorCode::cancelled, "the search was stopped");
  }
};

std::vector<const Effect*> candidates_of(const Model& model, const std::vector<std::string>& wanted) {
  std::vector<const Effect*> out;
  for (const auto& id : wanted) find_effect(id);
  for (const auto& effect : effect_catalogue()) {
    if (!wanted.empty() && std::ranges::find(wanted, effect.id) == wanted.end()) continue;
    // What the model has already is recalibrated, not found.
    const bool has =
        std::ranges::any_of(model.effects, [&](const auto& s) { return s.id == effect.id; }) ||
        (effect.id == "barrier_distribution" && model.polycrystal.barrier_log_std != 0) ||
        (effect.id == "interaction_field_distribution" && model.polycrystal.interaction_field_std != 0) ||
        (effect.id == "internal_bias_field" && model.polycrystal.bias_field != 0) ||
        (effect.id == "passive_layer_compliance" && model.actuator.passive_stiffness);
    if (has) continue;
    try {
      std::vector<double> values;
      for (const auto& p : effect.parameters) values.push_back(std::sqrt(p.low * p.high));
      auto trial = model;
      Ports ports;
      effect.install(values, trial, ports);
    } catch (const Error&) {
      continue;  // has no meaning for such a model
    }
    out.push_back(&effect);
  }
  return out;
}

void split(Session& s) {
  auto held = choose_held_out(s.bench);
  if (!s.options.held_out.empty()) {
    std::fill(held.begin(), held.end(), false);
    for (const auto& name : s.options.held_out) {
      const auto found = std::ranges::find(s.bench, name, &BenchRecording::name);
      if (found == s.bench.end()) {
        std::vector<std::string> names;
        for (const auto& r : s.bench) names.push_back(r.name);
        throw Error(
            ErrorCode::invalid_params, "there is no such recording to hold out",
            Problem{.path = "/held_out", .message = "is not among them", .given = name, .allowed = names});
      }
      held[static_cast<std::size_t>(found - s.bench.begin())] = true;
    }
  }
  for (std::size_t i = 0; i < s.bench.size(); ++i) {
    (held[i] ? s.held_out : s.train).push_back(i);
    (held[i] ? s.out.held_out : s.out.train).recordings.push_back(s.bench[i].name);
  }
  if (s.train.empty())
    throw Error(ErrorCode::invalid_params, "all recordings are held out: there is nothing to learn from");
}

// The cheapest simulation whose own error hardly shows in the residuals.
SimulationOptions choose_simulation(Session& s, const Hypothesis& base) {
  constexpr double hardly = 0.08;  // of the noise
  const Eigen::VectorXd z = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(base.coordinates.size()));
  const auto at = [&](const SimulationOptions& options) {
    return Misfit(s.bench, s.noise, s.train, options, s.threads).residuals(base, z);
  };
  const auto fine = at({.tolerance = 3e-5, .domains = 8000, .shift = 7});
  SimulationOptions out;
  for (const auto& [tolerance, domains] :
       {std::pair{1e-3, 250}, {3e-4, 500}, {3e-4, 1000}, {1e-4, 1000}, {1e-4, 2000}, {5e-5, 4000}}) {
    out = {.tolerance = tolerance, .domains = domains};
    s.out.health.numerical_error_over_noise =
        (at(out) - fine).norm() / std::sqrt(static_cast<double>(fine.size()));
    if (s.out.health.numerical_error_over_noise < hardly) break;
  }
  if (s.out.health.numerical_error_over_noise > 2 * hardly)
    s.out.health.warnings.push_back(
        "The noise is so low that the simulations' own error shows in the residuals.");
  return out;
}

// From the given model, and roughly from other starts: one of them may lead to a better minimum.
Fit fit_base(Session& s, const Misfit& misfit, const Hypothesis& base) {
  std::mt19937_64 random(s.options.seed);
  std::normal_distribution<double> normal;
  const auto n = static_cast<Eigen::Index>(base.coordinates.size());
  FitLimits limits{.iterations = 20, .refreshes = 4, .enough = 0.5, .tick = {}};
  limits.tick = [&] { s.tick("recalibrating the model", 0.03); };
  Fit best = fit(misfit, base, Eigen::VectorXd::Zero(n), limits);
  const Misfit rough(s.bench, s.noise, s.train, {.tolerance = 1e-3, .domains = 250}, s.threads);
  const FitLimits quick{.iterations = 8, .refreshes = 2, .enough = 5, .tick = limits.tick};
  const double reached = fit(rough, base, best.z, quick).squares;
  double least = std::numeric_limits<double>::infinity();
  for (int start = 1; start < base_starts; ++start) {
    Eigen::VectorXd z(n);
    for (Eigen::Index i = 0; i < n; ++i) z[i] = normal(random);
    limits.tick = [&] { s.tick("recalibrating from other starts", 0.1 + 0.15 * start / base_starts); };
    const auto other = fit(rough, base, z, quick);
    least = std::min(least, other.squares);
    if (other.squares > 0.98 * reached) continue;
    auto better = fit(misfit, base, other.z, limits);
    if (better.squares < best.squares) best = std::move(better);
  }
  refresh(misfit, best);
  s.out.health.starts = base_starts;
  s.out.health.start_spread = (least - reached) / reached;
  return best;
}

std::map<std::string, Recalibration> recalibrations(const Fit& fit, double numerical) {
  const Eigen::MatrixXd covariance = fit.normal().inverse();
  std::map<std::string, Recalibration> out;
  for (std::size_t i = 0; i < fit.hypothesis.base_count; ++i) {
    const auto& c = fit.hypothesis.coordinates[i];
    const auto k = static_cast<Eigen::Index>(i);
    out[c.path] = {
        c.from, c.value(fit.z[k]),
        widening(fit, numerical) * std::abs(c.slope(fit.z[k])) * std::sqrt(std::max(0.0, covariance(k, k)))};
  }
  return out;
}

Model model_at(const Fit& fit, const std::string& note) {
  auto out = setting_at(fit.hypothesis, fit.z).model;
  out.notes += (out.notes.empty() ? "" : " ") + note;
  return out;
}

void detectable(Session& s, const std::vector<Screened>& screened, double threshold) {
  for (const auto& c : screened) {
    if (c.excited < 9) {
      s.out.not_testable.emplace_back(c.effect->id);
      continue;
    }
    if (c.across <= 0) continue;
    const auto& p = c.effect->parameters.front();
    const Amplitude amplitude(p);
    s.out.smallest_detectable[std::string(c.effect->id)][std::string(p.name)] =
        amplitude.value(c.strength * std::sqrt(threshold / c.across));
  }
}

// Explanations that these recordings cannot tell apart.
void equivalences(Session& s, const Naming& naming, double samples, double close) {
  if (naming.trials.empty()) return;
  const auto& best = naming.trials.front();
  std::vector<std::string> group;
  for (const auto& t : naming.trials)
    if (t.effects.size() == 1 && best.effects.size() == 1 && score(t, samples) > score(best, samples) - close)
      group.emplace_back(t.effects[0]->id);
  if (group.size() > 1) s.out.equivalent.push_back(std::move(group));
}

}  // namespace

Discovery discover(const Model& base, std::vector<NamedRecording> recordings,
                   const DiscoverOptions& options) {
  Session s(options);
  s.threads = options.threads > 0 ? options.threads
                                  : static_cast<int>(std::max(1U, std::thread::hardware_concurrency()));
  s.tick("reading the recordings", 0);
  const auto candidates = candidates_of(base, options.candidates);
  s.bench = prepare(base, recordings, rows_together, s.out.health.warnings);
  recordings.clear();
  split(s);
  s.noise = estimate_noise(s.bench, s.out.health.warnings);
  for (std::size_t r = 0; r < s.bench.size(); ++r)
    for (std::size_t c = 0; c < s.bench[r].channels.size(); ++c) {
      auto& n = s.out.health.noise[s.bench[r].channels[c].channel];
      if (s.noise[r][c].std() > n.std)
        n = {s.noise[r][c].std(), s.noise[r][c].slow > 0, s.noise[r][c].correlation_time};
    }

  const auto hypothesis = base_hypothesis(base, s.bench);
  const auto simulation = choose_simulation(s, hypothesis);
  const Misfit misfit(s.bench, s.noise, s.train, simulation, s.threads);
  const auto samples = static_cast<double>(misfit.size());
  const Fit fitted = fit_base(s, misfit, hypothesis);

  NamingOptions naming_options{.candidates = candidates, .detect = 60, .second = 60, .tick = {}};
  naming_options.tick = [&](const std::string& stage, double f) { s.tick(stage, 0.3 + 0.6 * f); };
  const Naming naming = find_names(misfit, fitted, naming_options);
  const auto judgement = judge(naming, naming_options, samples);

  auto& out = s.out;
  out.verdict = judgement.verdict;
  out.probability_unknown = judgement.probability_unknown;
  out.probability_nothing = judgement.probability_nothing;
  const Trial* best = nullptr;
  if (out.verdict == Verdict::named || out.verdict == Verdict::ambiguous)
    best = judgement.trials.front().first;
  if (out.verdict != Verdict::nothing_missing)
    for (const auto& [trial, probability] : judgement.trials)
      out.explanations.push_back({estimates(*trial, out.health.numerical_error_over_noise), probability});
  if (best != nullptr)
    out.family = best->effects.front()->family;
  else if (out.verdict == Verdict::unknown)
    out.family = explained_by_signals(misfit, fitted).family;

  if (out.verdict == Verdict::ambiguous && judgement.trials.size() > 1) {
    s.tick("looking for the experiment that would decide", 0.91);
    out.next_experiment = choose_experiment(misfit, s.noise, judgement.trials[0].first->fit,
                                            judgement.trials[1].first->fit, evidence_scale);
  }
  s.tick("the proof", 0.95);
  const Fit& after = best != nullptr ? best->fit : fitted;
  const auto residuals = plain_residuals(misfit, fitted.hypothesis, fitted.z);
  out.where = excess_by_stretch(misfit, residuals);
  out.train.before = rms_by_channel(misfit, residuals);
  out.train.after = rms_by_channel(misfit, plain_residuals(misfit, after.hypothesis, after.z));
  if (!s.held_out.empty()) {
    const Misfit locked(s.bench, s.noise, s.held_out, simulation, s.threads);
    out.held_out.before = rms_by_channel(locked, plain_residuals(locked, fitted.hypothesis, fitted.z));
    out.held_out.after = rms_by_channel(locked, plain_residuals(locked, after.hypothesis, after.z));
    out.traces = traces(locked, fitted.hypothesis, fitted.z, after.hypothesis, after.z, 2, true);
  }
  for (auto& t : traces(misfit, fitted.hypothesis, fitted.z, after.hypothesis, after.z, 4, false))
    out.traces.push_back(std::move(t));
  out.recalibrated = recalibrations(after, out.health.numerical_error_over_noise);
  out.recalibrated_base = model_at(fitted, "Recalibrated on recordings.");
  out.improved = best != nullptr ? model_at(after, "Recalibrated on recordings, with what was found missing.")
                                 : out.recalibrated_base;
  detectable(s, naming.screened, naming_options.detect);
  equivalences(s, naming, samples, 20);
  for (const auto& t : naming.trials) {
    if (!t.checked || (best != nullptr && &t != best)) continue;
    out.health.largest_left = t.left;
    out.health.allowed_left = allowed_left(naming_options, t.drop);
    break;
  }
  out.health.simulations = misfit.simulations();
  out.health.seconds = std::chrono::duration<double>(Clock::now() - s.begin).count();
  out.sentences = findings(out);
  s.tick("done", 1);
  return std::move(s.out);
}

}  // namespace ferrobench::model

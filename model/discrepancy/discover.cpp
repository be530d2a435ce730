#include "model/discrepancy/discover.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <set>

#include "model/discrepancy/experiment.h"
#include "model/discrepancy/left_out.h"
#include "model/discrepancy/proof.h"
#include "model/discrepancy/report.h"
#include "model/discrepancy/search.h"
#include "model/discrepancy/signals.h"
#include "model/physics/domains.h"
#include "recordings/analysis/skew.h"

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
// Its error does not show: the usual simulation is corrected by it.
constexpr SimulationOptions fine_simulation{.tolerance = 1e-5, .domains = 1000, .shift = 7};
constexpr int most_domains = 16000;

using Clock = std::chrono::steady_clock;

struct Session {
  explicit Session(const DiscoverOptions& given) : options(given) {}
  const DiscoverOptions& options;
  Ticker tick = ticker(options);
  int threads = threads_of(options);
  Clock::time_point begin = Clock::now();
  Discovery out;
  std::vector<BenchRecording> bench;
  std::vector<std::vector<NoiseModel>> noise;
  std::vector<std::size_t> train, held_out;
};

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

// Whether one of them switches a spread on that the base does not have.
bool adds_a_spread(const Model& base, const std::vector<const Effect*>& candidates) {
  return base.polycrystal.method == PolycrystalMethod::distribution &&
         std::ranges::any_of(candidates, [&](const Effect* effect) {
           std::vector<double> values;
           for (const auto& p : effect->parameters) values.push_back(p.low);
           auto model = base;
           Ports ports;
           effect->install(values, model, ports);
           return spread_dimensions(model.polycrystal) > spread_dimensions(base.polycrystal);
         });
}

LeftOut left_out(const RecordingMisfit& misfit, const std::vector<double>& base, const Fit& with) {
  LeftOut out{.recordings = base.size()};
  const auto squares = squares_left_out(misfit, with);
  for (std::size_t i = 0; i < base.size(); ++i) {
    out.gain += base[i] - squares[i];
    out.better += squares[i] < base[i] ? 1 : 0;
  }
  return out;
}

// The workflow for one choice of what is locked away. Gives the locked recordings that the recalibrated base
// does not explain.
std::set<std::size_t> learn(Session& s, const Model& base, const std::vector<const Effect*>& candidates) {
  const auto hypothesis = base_hypothesis(base, s.bench);
  auto fine_options = stoppable(fine_simulation, s.options);
  fine_options.every_spread = adds_a_spread(base, candidates);
  RecordingMisfit misfit(s.bench, s.noise, s.train, stoppable({}, s.options), s.threads);
  RecordingMisfit fine(s.bench, s.noise, s.train, fine_options, s.threads);
  s.tick("choosing how finely to simulate", 0.01);
  choose_simulations(misfit, fine, hypothesis, most_domains, s.out.health);
  const auto found =
      search(misfit, fine, hypothesis,
             {.candidates = candidates,
              .seed = s.options.seed,
              .small_against = 1e-4,
              .most_domains = most_domains,
              .roughly_fitted =
                  [&](const Fit& f) {
                    misfit.allow_for_drives(f.hypothesis, f.z);
                    fine.allow_as(misfit);
                  },
              .beyond_effects = [&](const Fit& f) { return explained_by_signals(misfit, f).beyond_chance; },
              .tick = s.tick},
             s.out.health);

  auto& out = s.out;
  tell(found, out);
  const Fit &fitted = found.base, &after = found.after();
  if (s.train.size() > 1 && !out.explanations.empty()) {
    const auto without = squares_left_out(misfit, fitted);
    for (std::size_t i = 0; i < out.explanations.size(); ++i)
      out.explanations[i].left_out = left_out(misfit, without, found.judgement.trials[i].first->fit);
  }
  if (out.verdict == Verdict::unknown) {
    const auto explained = explained_by_signals(misfit, fitted);
    out.family = explained.family;
    out.signals = reconstructed(misfit, fitted, explained);
  }
  if (const auto& rivals = found.judgement.trials; out.verdict == Verdict::ambiguous && rivals.size() > 1) {
    s.tick("looking for the experiment that would decide", 0.91);
    out.next_experiment =
        choose_experiment(misfit, s.noise, rivals[0].first->fit, rivals[1].first->fit, evidence_scale);
  }
  s.tick("the proof", 0.95);
  std::set<std::size_t> strange;
  const bool added = found.best != nullptr;
  const auto before_it = predict(fine, misfit, fitted),
             after_it = added ? predict(fine, misfit, after) : before_it;
  out.where = excess_by_stretch(fine, before_it.residuals);
  out.train.before = rms_by_channel(fine, before_it.residuals);
  out.train.after = rms_by_channel(fine, after_it.residuals);
  if (!s.held_out.empty()) {
    const RecordingMisfit locked(s.bench, s.noise, s.held_out, fine.simulation(), s.threads);
    const RecordingMisfit locked_usual(s.bench, s.noise, s.held_out, misfit.simulation(), s.threads);
    const auto locked_before = predict(locked, locked_usual, fitted),
               locked_after = added ? predict(locked, locked_usual, after) : locked_before;
    strange = unexplained(locked, locked_before.residuals);
    out.held_out.before = rms_by_channel(locked, locked_before.residuals);
    out.held_out.after = rms_by_channel(locked, locked_after.residuals);
    out.traces = traces(locked, locked_before, locked_after, 2, true);
  }
  for (auto& t : traces(fine, before_it, after_it, 4, false)) out.traces.push_back(std::move(t));
  out.health.simulations += misfit.simulations();
  return strange;
}

}  // namespace

Discovery discover(const Model& base, std::vector<NamedRecording> recordings,
                   const DiscoverOptions& options) {
  Session s(options);
  s.tick("reading the recordings", 0);
  const auto candidates = candidates_of(base, options.candidates);
  for (auto& r : recordings) ferrobench::recordings::remove_skew(r.recording);
  s.bench = prepare(base, recordings, rows_together, s.out.health.warnings, stoppable({}, options).stop);
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
  auto strange = learn(s, base, candidates);
  if (s.out.verdict == Verdict::nothing_missing && !strange.empty() && options.held_out.empty()) {
    // What is missing shows only there: so those are learned from, and others locked away.
    const int simulations = s.out.health.simulations;
    s.out = as_read;
    s.out.health.simulations = simulations;
    s.out.health.warnings.push_back("What the others do not show was found in " + names_of(s, strange) +
                                    ", locked away at first: learned from, and others locked away instead.");
    const auto tick = s.tick;
    s.tick = [tick](const std::string& stage, double f) { tick(stage, 0.95 + 0.05 * f); };
    split(s, choose_held_out(s.bench, strange));
    strange = learn(s, base, candidates);
  }
  auto& out = s.out;
  if (out.verdict == Verdict::nothing_missing && !strange.empty())
    out.health.warnings.push_back("What was locked away is not explained in " + names_of(s, strange) +
                                  ": something may be missing that shows only there.");
  out.health.seconds = std::chrono::duration<double>(Clock::now() - s.begin).count();
  out.sentences = findings(out);
  s.tick("done", 1);
  return std::move(s.out);
}

}  // namespace ferrobench::model

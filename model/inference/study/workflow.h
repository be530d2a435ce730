// What `discover` does for recordings and for published tables alike, from residuals to a judged explanation:
// recalibration of the base model, forward selection of effects, verdict.
#pragma once

#include <atomic>
#include <functional>
#include <string>
#include <vector>

#include "model/inference/observation/noise.h"
#include "model/inference/selection/verdict.h"
#include "model/inference/study/discover.h"
#include "model/inference/study/improvement.h"

namespace ferrobench::model::inference {

// The following hold for as long as `options`.
int threads_of(const DiscoverOptions& options);
// Stopped as these want it, and counted.
SimulationOptions watched(SimulationOptions simulation, const DiscoverOptions& options,
                          std::atomic<std::uint64_t>& begun);
// Reports progress; throws Error(cancelled) if that is wanted.
using Ticker = std::function<void(const std::string& stage, double fraction)>;
Ticker ticker(const DiscoverOptions& options);

// Throws Error(invalid_params) unless all of `wanted` are among `names`, and not all of these.
void check_held_out(const std::vector<std::string>& wanted, const std::vector<std::string>& names);
// Throws Error(invalid_params) if they make no sense.
void check_selection(const SelectionOptions& options);
void check_floor(double floor);

// Without the sources.
Asked asked_of(const Model& base, const DiscoverOptions& options);

// The largest of each channel.
void summarize_noise(const std::vector<BenchRecording>& bench,
                     const std::vector<std::vector<NoiseModel>>& noise, Health& health);

struct WorkflowOptions {
  std::vector<const Effect*> candidates;
  std::uint64_t seed = 1;
  Eigen::VectorXd start{};  // of the recalibration, scaled; empty: the given values
  int most_domains = 0;     // of the fine simulation
  SelectionOptions selection;
  // Called once the base model stands roughly; changes the residuals.
  std::function<void(const Fit&)> roughly_fitted;
  // Whether the recalibrated base is so far off that no single effect may be expected to explain the rest;
  // then none is looked for. Null: never.
  std::function<bool(const Fit&)> is_gross{};
  // The drop that functions of the signals would still bring; null: not asked.
  std::function<double(const Fit&)> beyond_effects;
  Ticker tick;
};

struct WorkflowResult {
  Fit base;  // recalibrated
  ForwardSelection forward;
  ModelSelection selection;
  double samples = 0;
  const Trial* best = nullptr;  // what is added to the model, if anything
  bool gross = false;           // the base is far off; nothing was looked for

  const Fit& after() const { return best != nullptr ? best->fit : base; }
};

// `coarse` and `fine` have the fidelities that were chosen for the base model (solver/multifidelity.h); that
// of `fine` is raised where an explanation wants it.
WorkflowResult run_workflow(const WhitenedResiduals& coarse, WhitenedResiduals& fine, const Hypothesis& base,
                            const WorkflowOptions& options, Health& health);

// What a fit moved of the base model, and by how much.
std::map<std::string, Recalibration> recalibrations(const Fit& fit, const SelectionOptions& options);
// The model of a fit, with this remark.
Model model_at(const Fit& fit, const std::string& note);
// Values of added terms with 90 % intervals, where a fit stands; what was held fixed has none.
void estimate_terms(const Fit& fit, const Hypothesis& hypothesis, const Eigen::VectorXd& z, double tempering,
                    std::vector<AddedTerm>& added);
// Fills in what the workflow says of effects, parameters and models.
void summarize(const WorkflowResult& found, const SelectionOptions& options, Discovery& out);
// Verdict and explanations of an improvement that looked for names itself and found some.
void summarize_named(const Improvement& found, const SelectionOptions& options, Discovery& out);

}  // namespace ferrobench::model::inference

// The pasts of recordings that name none, beside the recalibration of a model.
//
// Pasts and the model's numbers are estimated in turn until the pasts stay: a past by its likelihood under
// the noise where the model stands, the numbers by least squares under these pasts. What is presumed of all,
// poled towards +, stands unless the pasts that were found leave less than half of its sum of squares, both
// recalibrated: an effect that the model lacks is made up for by pasts as well, though seldom that far.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "model/inference/observation/noise.h"
#include "model/inference/residuals/whitened_recordings.h"
#include "model/inference/solver/gauss_newton.h"
#include "model/inference/study/discover.h"

namespace ferrobench::model::inference {

struct UnknownPasts {
  std::vector<BenchRecording>& bench;  // given its pasts here
  const std::vector<std::vector<NoiseModel>>& noise;
  const std::vector<std::size_t>& train;
  std::vector<bool> unknown;                                // of the bench: which name none
  std::vector<std::vector<protocols::Past>> by_succession;  // of the bench (dataset/succession.h)
  SimulationOptions simulation;                             // of the fits; what stops it is used in all
  int threads = 1;
  std::function<void(const std::string& stage)> tick;
};

// The likeliest pasts where a fit stands, in the bench's order; known ones as they are.
std::vector<protocols::Past> likeliest_pasts(const UnknownPasts& of, const Hypothesis& hypothesis,
                                             const Eigen::VectorXd& z);

// Under the model as it is given. Poled towards +, as the simulator does, is presumed of all that name none,
// unless that leaves much of a recording where another past leaves less than half of it. Of `watched`, what
// stops simulations and counts them is used.
std::vector<protocols::Past> likeliest_pasts_as_given(const Model& model,
                                                      const std::vector<RecordingData>& data,
                                                      SimulationOptions watched);
// By misses over the range, under a model that was recalibrated: where it is wrong by much.
std::vector<protocols::Past> likeliest_pasts_over_range(const Model& model,
                                                        const std::vector<RecordingData>& data,
                                                        SimulationOptions watched);

struct SettledPasts {
  bool presumed = false;  // what is presumed of all stands
  Eigen::VectorXd z{};    // where the recalibration ended; empty where it left much (is_gross)
};

// From poled towards +, as is presumed, and from the pasts that the bench has. Leaves it with those that were
// settled on.
SettledPasts settle_pasts(const UnknownPasts& of, const Hypothesis& base);

// Levels and times of the visits that were estimated, where another fit stands.
void refine_pasts(const UnknownPasts& of, const Hypothesis& hypothesis, const Eigen::VectorXd& z);

// A visit to one level that nobody recorded has a free level and a free time then.
void set_pasts(const UnknownPasts& of, const std::vector<protocols::Past>& pasts);
// Pasts that were chosen over the range: those that change are not free any more.
void hold_pasts(std::vector<BenchRecording>& bench, const std::vector<protocols::Past>& pasts);
std::vector<protocols::Past> pasts_of(const std::vector<BenchRecording>& bench);

}  // namespace ferrobench::model::inference

// A recording's own program played through a model: what the model says should have been measured.
#pragma once

#include "model/simulator.h"
#include "recordings/format/recording.h"

namespace ferrobench::model {

// The recording's specimen and load win over the model's actuator and load.
Model model_for(const Model& model, const recordings::Header& recording);

// The field that the recording was driven by: its command, or the measured field if there is none, in V/m at
// its own times; gaps are bridged by a straight line. Throws Error(bad_recording) if it has neither.
std::vector<double> played_field(const recordings::Recording& recording);

// What the model gives at the recording's times under the played field, after the past of the options or, if
// they name none, the recording's.
Trajectory simulate_on(const Model& model, const recordings::Recording& recording,
                       const SimulationOptions& options = {}, bool estimate_quadrature = false);

const std::vector<double>& channel_of(const Trajectory& trajectory, recordings::Channel channel);

}  // namespace ferrobench::model

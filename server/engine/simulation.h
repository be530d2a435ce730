// A recording's own program played through a model, without noise: what the model says that should have been
// measured.
#pragma once

#include <functional>
#include <optional>

#include "recordings/format/recording.h"

namespace ferrobench::server {

struct Simulation {
  recordings::Recording recording;
  // Estimates by the model itself, see model/simulator.h.
  double time_error = 0, quadrature_error = 0;
};

// Plays `command` (the measured field if there is none) at the recording's own times. `model` null: the
// recording's. The recording's specimen and load win over the model's actuator and load. `past`: what the
// specimen has been through before; none: the recording's or, where that is not known, poled towards +. It
// stands in the new recording. Segments, protocol and the reference of the charge carry over. `origin` names
// the source in the device's description. `stop`, asked all the time, ends it with Error(cancelled). Throws
// Error(invalid_params) if there is no model, and what model::simulate_on throws.
Simulation simulate_recording(const recordings::Recording& recording, const nlohmann::json& model,
                              const std::string& origin, const std::optional<protocols::Past>& past = {},
                              const std::function<bool()>& stop = {});

}  // namespace ferrobench::server

// A replay from start to end into a recording in memory: the guard, the device and the scaling, without a
// file.
#pragma once

#include <functional>

#include "daq/replay/replay_device.h"

namespace ferrobench::daq {

struct Replay {
  recordings::Recording recording;
  Outcome outcome;
};

// `bench` are the limits of the bench (ReplaySource::limits). `go_on` is told the share that has been played,
// and false stops it safely. Throws what Guard::start throws; the outcome says what happened after.
Replay play(ReplayDevice& device, const Limits& bench, const std::function<bool(double)>& go_on = {});

}  // namespace ferrobench::daq

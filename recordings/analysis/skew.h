// A multiplexer reads the channels of a row one after the other: "skew_s" in the device's description of a
// channel says how long after the row's time. For analysis each channel is brought back to it, linearly
// between its samples:
//
//   x(t_i) = x_i - (x_i - x_{i-1}) skew / (t_i - t_{i-1})
//
// exact for what is linear over two samples; the noise of neighbours mixes a little. The first row, and rows
// beside a gap, stay as they are. Files keep what was measured.
#pragma once

#include "recordings/format/recording.h"

namespace ferrobench::recordings {

// By Channel, in s; 0 where nothing sensible is said. A replay has those of what it plays.
std::array<double, 5> skew_of(const nlohmann::json& device);
// Whether the recording was skewed at all.
bool remove_skew(Recording& recording);

}  // namespace ferrobench::recordings

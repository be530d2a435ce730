// The sines on a bias of small_signal segments (protocols/segments.h), where a recording has them.
#pragma once

#include <cstddef>
#include <vector>

#include "recordings/format/recording.h"

namespace ferrobench::recordings {

enum class Approach { none, up, down };

// One sine of a small_signal segment, as played from its first to its last sample, both at the bias.
struct BiasSine {
  std::size_t first = 0, last = 0;
  double bias = 0, amplitude = 0;  // V/m, as commanded
  double cycles = 0;
  Approach approach = Approach::none;  // direction of the last ramp before it
};
// Samples: those of one cycle, sampled as slowly as allowed.
inline constexpr std::size_t fewest_in_sine = 20;

// Of the recording's protocol, those that were played to their end; none where the recording has no protocol
// or no segments. Takes as long as expanding the protocol does.
std::vector<BiasSine> bias_sines(const Recording& recording);

}  // namespace ferrobench::recordings

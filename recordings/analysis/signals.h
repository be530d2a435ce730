// The channels as the reports measure them: polarization from charge, and values freed of noise.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "recordings/analysis/cycles.h"
#include "recordings/format/recording.h"

namespace ferrobench::recordings {

// One channel, with the standard deviation of its noise: the recording's own figure, or an estimate from the
// samples.
struct Signal {
  std::span<const double> values;                 // those of the recording, which outlives this,
  std::shared_ptr<std::vector<double>> own = {};  // or these
  double noise = 0;
  // Noise so small that single samples can be trusted (below a millionth of the range).
  bool exact = true;
};

Signal signal(const Recording& recording, Channel channel);
// P = Q / (n A) [C/m^2], electrodes in parallel. Relative to the first sample if the charge is.
Signal polarization(const Recording& recording);
// The field measured, or the one commanded where it was not.
const std::vector<double>& field_of(const Recording& recording);

// Local parabolas, least squares, over a twentieth of a leg (at most 101 samples) and never across a turning
// point, so that a cusp stays one. An exact signal comes back as it is.
Signal smoothed(Signal signal, const std::vector<Turn>& turns);

// Value at sample `at`, one end of a stretch of `count` samples that begins at `first`: the sample itself if
// the signal is exact, else a line through as many samples next to it as bring the noise to 1 % of the
// stretch's change, a hundredth of the stretch (5 samples at least) at the most.
double edge_value(const Recording& recording, const Signal& signal, std::size_t first, std::size_t count,
                  bool at_end);

}  // namespace ferrobench::recordings

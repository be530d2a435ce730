// Where a fit and the recordings disagree, and by how much, as a lab would look at it: residuals over the
// noise, not whitened, offsets taken out.
#pragma once

#include <set>

#include "model/discrepancy/least_squares.h"

namespace ferrobench::model::discrepancy {

// By recording (in the order of misfit.chosen()), channel and row.
using Signals = std::vector<std::vector<std::vector<double>>>;
struct Prediction {
  Signals simulated;  // SI
  Signals residuals;  // measured less simulated, over noise; NaN where not measured
};
// By the fine simulation; drives that were read from a measured field are settled (misfit.h), for which the
// usual one of the same recordings makes the slopes.
Prediction predict(const RecordingMisfit& fine, const RecordingMisfit& usual, const Fit& fit);

ChannelFigures rms_by_channel(const RecordingMisfit& misfit, const Signals& residuals);
// Recordings (indices in the bench) of which a channel is further from the noise than its level may be off.
std::set<std::size_t> unexplained(const RecordingMisfit& misfit, const Signals& residuals);
// By recording, channel and kind of stretch; worst first.
std::vector<Excess> excess_by_stretch(const RecordingMisfit& misfit, const Signals& residuals);

// The stretches in which an explanation took away most, at most `count`, one for each channel and recording.
std::vector<Trace> traces(const RecordingMisfit& misfit, const Prediction& before, const Prediction& after,
                          std::size_t count, bool held_out);

}  // namespace ferrobench::model::discrepancy

// Where a fit and the recordings disagree, and by how much, as a lab would look at it: residuals over the
// noise, not whitened, offsets taken out.
#pragma once

#include <set>

#include "model/discrepancy/least_squares.h"

namespace ferrobench::model::discrepancy {

// Residuals over noise by recording (in the order of misfit.chosen()) and channel; NaN where not measured.
using Residuals = std::vector<std::vector<std::vector<double>>>;
Residuals plain_residuals(const RecordingMisfit& misfit, const Hypothesis& hypothesis,
                          const Eigen::VectorXd& z);

ChannelFigures rms_by_channel(const RecordingMisfit& misfit, const Residuals& residuals);
// Recordings (indices in the bench) of which a channel is further from the noise than its level may be off.
std::set<std::size_t> unexplained(const RecordingMisfit& misfit, const Residuals& residuals);
// By recording, channel and kind of stretch; worst first.
std::vector<Excess> excess_by_stretch(const RecordingMisfit& misfit, const Residuals& residuals);

// The stretches in which an explanation took away most, at most `count`, one for each channel and recording.
std::vector<Trace> traces(const RecordingMisfit& misfit, const Hypothesis& before,
                          const Eigen::VectorXd& z_before, const Hypothesis& after,
                          const Eigen::VectorXd& z_after, std::size_t count, bool held_out);

}  // namespace ferrobench::model::discrepancy

// The segments of a field program, where the recording does not say them.
#pragma once

#include <limits>
#include <vector>

#include "recordings/format/recording.h"

namespace ferrobench::recordings {

// Segments from the command (or field) alone, for a recording that has none: runs of constant slope. A ramp
// is cut in two at a bend too slight to be sure of where that takes more than `bend` of the noise's squares
// off.
std::vector<SegmentRow> infer_segments(const Recording& recording,
                                       double bend = std::numeric_limits<double>::infinity());

// The recording's segment table, or the inferred one if it has none.
std::vector<SegmentRow> segments_of(const Recording& recording);

}  // namespace ferrobench::recordings

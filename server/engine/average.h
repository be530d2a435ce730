// A recording's mean over the passes of a repeat, as a recording of its own.
#pragma once

#include "recordings/analysis/mean_of_passes.h"

namespace ferrobench::server {

// With an identifier of its own. Throws Error(bad_recording) that says why there is no mean.
recordings::MeanOfPasses average_recording(const recordings::Recording& recording);

}  // namespace ferrobench::server

// The same experiment again, from what its recording alone holds.
#pragma once

#include "recordings/format/recording.h"
#include "server/engine/request.h"

namespace ferrobench::server {

// What run.start has to be asked for. On the virtual device the same seed gives the same samples, if the
// specimen was new then and nobody paused or stopped the run; any other device gives a new recording. Either
// says by `rerun_of` which one it repeats.
// Throws Error(bad_recording) if the recording does not say how it was made, or was not measured.
RunRequest rerun_request(const recordings::Recording& recording);

}  // namespace ferrobench::server

// A part of a recording, as a recording of its own.
#pragma once

#include <optional>

#include "recordings/format/recording.h"

namespace ferrobench::recordings {

// The rows from `from` to `to` [s], both included; none: from the start, to the end. Its time begins at 0,
// and segments and events move along; a segment is cut where the window cuts it. Without either the recording
// comes back as it was. Of a part that begins later nothing is said of the specimen's past. Throws
// Error(invalid_params) if fewer than two rows are left.
Recording window(Recording recording, std::optional<double> from, std::optional<double> to);

}  // namespace ferrobench::recordings

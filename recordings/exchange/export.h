// A recording's samples for other programs.
#pragma once

#include <iosfwd>

#include "recordings/format/recording.h"

namespace ferrobench::recordings {

// A heading line "time_s,command_V_per_m,...", then one line per sample, numbers in full; a gap is an empty
// cell.
void export_csv(const Recording& recording, std::ostream& out);

// {title, status, specimen, load, segments, events, columns: {time_s: [...], ...}}; a gap is null.
void export_json(const Recording& recording, std::ostream& out);

}  // namespace ferrobench::recordings

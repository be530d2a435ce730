// Whether a recording made again is the one that it repeats.
#pragma once

#include <optional>
#include <string>

#include "recordings/analysis/difference.h"

namespace ferrobench::server {

// None if samples (to the bit), raw counts, segments, events, noise, status and report agree; else the first
// difference in words: where, and both values. What names the run rather than what was measured (start,
// device, identifier) may differ, and so may the command of a recording that had none. Raw counts that the
// replay did not play are not looked at.
std::optional<std::string> first_difference(const recordings::Recording& recorded,
                                            const recordings::Recording& replayed);

// "row 17: 1.5 and 1.25 V/m"
std::string in_words(const recordings::ColumnDifference& column);

}  // namespace ferrobench::server

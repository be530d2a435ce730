// What recording.read gives of a loop: {axes, chord_error, told_by, cycles, curves: [{cycle, label, rate,
// frequency_Hz, x, y}]}.
#pragma once

#include <string>
#include <vector>

#include "recordings/format/recording.h"

namespace ferrobench::server {

// `axes`: two of "time" and the channels, or "time_in_hold" and a channel: the change since the start of each
// long hold, of the whole recording (creep.h). Rows first .. first + rows - 1, at most `most` points in all.
// The points left out lie within `chord_error` of the line, as a share of the axes' ranges: half of one of
// `pixels`, more only where that many points do not do. Error(invalid_params) for other axes.
nlohmann::json curves_of(const recordings::Recording& recording, const std::vector<std::string>& axes,
                         std::size_t first, std::size_t rows, std::size_t pixels, std::size_t most);

// The segment table, at most 1000 rows; inferred from the program where the recording has none.
nlohmann::json segment_rows(const recordings::Recording& recording);

// Of recording.read, with or without axes.
nlohmann::json curves_schema();

}  // namespace ferrobench::server

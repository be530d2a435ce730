// What must hold of samples and segments wherever they were read from, so that all others can rely on it.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "recordings/format/recording.h"

namespace ferrobench::recordings {

// Each is Error(bad_recording), with the place in `file`. Samples before `from` have been looked at already.
void demand_rising(std::span<const double> time, std::size_t from, const std::string& file);
// NaN marks a gap; infinity is never measured.
void demand_finite(Channel channel, std::span<const double> values, std::size_t from,
                   const std::string& file);
// All of it, and that segments lie within the samples.
void demand_sound(const Recording& recording, const std::string& file);

// Segments of a run that may have ended before them: cut to the rows that there are.
std::vector<SegmentRow> within(std::span<const SegmentRow> segments, std::uint64_t rows);

}  // namespace ferrobench::recordings

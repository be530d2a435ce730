// How a process talks with the child that reads HDF5 files for it (read_apart.h).
//
// The child's standard input is a file in memory with the paths, each ended by a zero byte; there it leaves
// the columns of a recording in their place (Frame::column_bytes()). To its standard output it writes, for
// each path, a line of JSON: an error, or the frame's counts; after these what a journal begins and ends
// with, and the events, each a line too.
#pragma once

#include <string_view>

namespace ferrobench::recordings {

inline constexpr std::string_view child_name = "ferrobench: reads files apart";
inline constexpr std::string_view whole_recordings = "all", summaries = "summary";

// Arguments: name, what is wanted, milliseconds of the processor for each file, bytes of a recording. Does
// not return.
[[noreturn]] void serve_as_child(std::string_view wanted, long milliseconds, double most_bytes);

}  // namespace ferrobench::recordings

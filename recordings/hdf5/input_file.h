// A recording's HDF5 file, read by the HDF5 library: what a child process does (read_apart.h).
#pragma once

#include <functional>
#include <string>

#include "recordings/format/parts.h"

namespace ferrobench::recordings {

// All but the samples.
struct Frame {
  Begin begin;
  Ending ending;
  std::vector<Event> events;
  std::uint64_t rows = 0;
  // Of what a summary only counts.
  double duration = 0;
  std::uint64_t segment_count = 0, event_count = 0;

  std::uint64_t column_bytes() const { return rows * begin.row_bytes(); }
};

Frame summarize_hdf5(const std::string& path);  // neither segments, events nor noise
// `memory_for` is asked once, for Frame::column_bytes(): time, the channels and the counts are put there, one
// column after the other.
Frame read_hdf5(const std::string& path, double most_bytes,
                const std::function<char*(std::uint64_t bytes)>& memory_for);

}  // namespace ferrobench::recordings

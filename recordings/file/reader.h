// Reads recordings: the HDF5 file, or its journal where the file is not there yet.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "recordings/format/parts.h"

namespace ferrobench::recordings {

// Any file with the parts that the format marks as required is a recording, whoever wrote it.
// Throws Error(not_found) or Error(bad_recording) with the place in the file. Where only the journal of a run
// is there, that is read: status "running", or "broken_off" if nobody writes it any more.
Recording read_recording(const std::string& path);
// The same of one that takes no more memory: Error(bad_recording) says how much it would.
Recording read_recording(const std::string& path, double most_bytes);
Summary read_summary(const std::string& path);
// Of many, in the order asked for, in little more time than of one.
std::vector<SummaryOrError> read_summaries(std::span<const std::string> paths);

}  // namespace ferrobench::recordings

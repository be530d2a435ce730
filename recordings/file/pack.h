// The HDF5 file of a recording, made in one go under another name and put in its place when all of it is on
// the disk.
#pragma once

#include "recordings/disk/new_file.h"
#include "recordings/journal/reader.h"

namespace ferrobench::recordings {

// Segments are cut to the rows that there are. `progress` hears of the share
// done, 0 to 1.
void pack(const JournalReader& journal, const Ending& ending, std::span<const Event> events,
          const std::string& path, Existing existing, const std::function<void(double)>& progress = nullptr);
void pack(const Recording& recording, const std::string& path, Existing existing);

}  // namespace ferrobench::recordings

// HDF5 files whose structure has no checksums, as most programs write them. The library believes what such a
// file says of itself, and crashes over a damaged one. So a child process reads it, which is this program
// once more, and hands over what it read; a crash there is an error here.
#pragma once

#include <string>

#include "recordings/journal_reader.h"
#include "recordings/recording.h"

namespace ferrobench::recordings {

// Whether the library finds damage to the file's structure before it believes it.
bool has_checksums(const std::string& path);
// Error as the reader in the child threw it; Error(bad_recording) if it crashed or did not end.
JournalReader read_apart(const std::string& path);  // as a journal
Summary summarize_apart(const std::string& path);   // without reading the samples

// By the reader, for the child.
Recording read_hdf5(const std::string& path);
Summary summarize_hdf5(const std::string& path);

}  // namespace ferrobench::recordings

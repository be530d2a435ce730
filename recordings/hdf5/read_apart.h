// HDF5 files are read in a child process, which is this program once more: the library believes what a file
// says of itself, and crashes over a damaged one, or works for ever. Such an end of the child is an error
// here. Only what this process has just written is looked at in place (file/pack.cpp).
#pragma once

#include <chrono>
#include <span>
#include <string>
#include <variant>
#include <vector>

#include "recordings/format/parts.h"

namespace ferrobench::recordings {

// What a child may take for one file.
struct ReadLimits {
  std::chrono::milliseconds processor, clock;
  double recording_bytes;  // of all samples, as they lie in memory
};
// In proportion to the file, and to the memory of this machine.
ReadLimits limits_for(const std::string& path);
// From now on no recording that this process reads may take more than this share of the memory; at first a
// half.
void allow_each_recording(double share_of_memory);
double memory_for_each_recording();  // in bytes

// Error as the child's reader threw it; Error(bad_recording) if it crashed or took more than it may.
Recording read_apart(const std::string& path, const ReadLimits& limits);
Recording read_apart(const std::string& path);
// Without samples. One child reads them one after the other, so that many do not take long.
std::vector<SummaryOrError> summarize_apart(std::span<const std::string> paths);

}  // namespace ferrobench::recordings

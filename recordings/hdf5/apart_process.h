// A child process that reads HDF5 files (read_apart.h), as its parent sees it.
#pragma once

#include <chrono>
#include <optional>

#include "recordings/disk/durable_file.h"
#include "recordings/hdf5/input_file.h"
#include "recordings/hdf5/read_apart.h"
#include "recordings/process/child.h"

namespace ferrobench::recordings {

Error unreadable(const std::string& path, ErrorCode code, const std::string& message,
                 const std::string& hint = "");

// The child came to an end over a file.
struct Ended {
  Error error;
};

class ReadingChild {
 public:
  ReadingChild(std::string_view wanted, std::span<const std::string> paths, const ReadLimits& limits);

  // What it tells of the next path. Error that it tells, or Ended.
  Frame next(const std::string& path, const ReadLimits& limits);
  const Descriptor& columns() const { return shared_; }

 private:
  std::string line(const std::string& path, std::chrono::steady_clock::time_point until,
                   const ReadLimits& limits);
  [[noreturn]] void say_why(const std::string& path, const ReadLimits& limits);

  Descriptor shared_, told_;
  std::string text_;  // of what it told, not yet taken
  std::optional<Child> child_;
};

}  // namespace ferrobench::recordings

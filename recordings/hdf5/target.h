// The file below an HDF5 file that is being written. HDF5 1.10 crashes later on when a write or the close of
// its own driver has failed, so none ever fails for it: the first failure is kept here, what is written after
// it goes nowhere, and the caller asks.
#pragma once

#include <cstdint>
#include <string>

#include "recordings/disk/new_file.h"
#include "recordings/hdf5/handle.h"

namespace ferrobench::recordings::hdf5 {

class Target {
 public:
  explicit Target(const NewFile& file) : file_(file) {}

  // An empty HDF5 file that writes here, of a version that puts checksums on everything, and without times
  // of its own. This must outlive it.
  Handle create();
  void check() const;  // Error(disk_full | io_error) if anything has failed so far

  // For the driver.
  void write(std::uint64_t place, const char* bytes, std::size_t count);
  void read(std::uint64_t place, char* bytes, std::size_t count);  // zeros where there is nothing
  void cut(std::uint64_t size);
  std::uint64_t size() const { return size_; }

 private:
  const NewFile& file_;
  std::uint64_t size_ = 0;
  int failure_ = 0;  // errno
};

}  // namespace ferrobench::recordings::hdf5

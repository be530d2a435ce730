// Makes groups, datasets and attributes in an HDF5 file by their paths. Parents must exist.
// Whatever fails is Error(disk_full) or Error(io_error) with the path inside the file.
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "recordings/hdf5/handle.h"

namespace ferrobench::recordings::hdf5 {

class Output {
 public:
  // Takes the open (or failed) file; `path` is where it lies.
  Output(Handle file, std::string path);

  hid_t id() const { return file_.get(); }
  void need(bool done, const std::string& place) const;

  void group(const std::string& place, const std::string& nx_class);
  void text(const std::string& place, const std::string& value);
  void texts(const std::string& place, std::span<const std::string> values);
  void number(const std::string& place, double value, const std::string& unit);
  void integer(const std::string& place, std::int64_t value);
  void numbers(const std::string& place, std::span<const double> values, const std::string& unit);
  void integers(const std::string& place, std::span<const std::int64_t> values);

  // Of variable length, as NeXus viewers compare them as they come; the others stand in the checksummed
  // header.
  void attribute(const std::string& place, const char* name, const std::string& value);
  void fixed_attribute(const std::string& place, const char* name, const std::string& value);
  void attribute(const std::string& place, const char* name, std::span<const std::string> values);
  void attribute(const std::string& place, const char* name, std::span<const double> values);
  void attribute(const std::string& place, const char* name, std::int64_t value);

  void flush();  // to the operating system
  void close();

 private:
  void write(const std::string& place, const Handle& type, const Handle& space, const void* data);
  void annotate(const std::string& place, const char* name, const Handle& type, const Handle& space,
                const void* data);

  Handle file_;
  std::string path_;
};

Handle text_type(std::size_t size = H5T_VARIABLE);  // UTF-8

}  // namespace ferrobench::recordings::hdf5

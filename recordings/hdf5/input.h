// Reads an HDF5 file that somebody else may have made, or damaged. Nothing is followed but hard links,
// nothing is allocated that the file could not hold, and whatever does not fit is Error(bad_recording) with
// its path.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "recordings/hdf5/handle.h"

namespace ferrobench::recordings::hdf5 {

class Input {
 public:
  explicit Input(const std::string& path);  // Error(not_found) or Error(bad_recording)

  // Is there an object of this name? A soft or external link on the way is an error.
  bool has(const std::string& place) const;

  // Scalars (one element, whatever the rank). None if absent.
  std::optional<double> number(const std::string& place) const;
  std::optional<std::int64_t> integer(const std::string& place) const;
  std::optional<std::string> text(const std::string& place) const;  // valid UTF-8

  // Elements along the first dimension; `columns` is the second one's, 0 for a plain list.
  struct Size {
    std::uint64_t rows = 0;
    std::uint64_t columns = 0;
  };
  Size numeric_size(const std::string& place) const;
  // The first rows of a numeric dataset, as many as `to` takes; `after_block` hears how many are there.
  void numbers(const std::string& place, std::span<double> to,
               const std::function<void(std::size_t done)>& after_block = nullptr) const;
  std::vector<double> numbers(const std::string& place, std::uint64_t rows) const;
  // Last minus first of the first `rows` numbers, without reading those between.
  double span_of(const std::string& place, std::uint64_t rows) const;
  std::vector<std::int64_t> integers(const std::string& place, std::uint64_t rows) const;
  // Of `columns` columns, row after row.
  void counts(const std::string& place, std::size_t columns, std::span<std::int16_t> to) const;
  std::vector<std::string> texts(const std::string& place) const;

  std::optional<std::string> text_attribute(const std::string& place, const char* name) const;
  std::vector<std::string> text_attributes(const std::string& place, const char* name) const;
  std::vector<double> number_attributes(const std::string& place, const char* name) const;

  [[noreturn]] void fail(const std::string& place, const std::string& message,
                         const std::string& hint = "") const;

 private:
  Handle open(const std::string& place) const;
  Handle open_numeric(const std::string& place, Size& size) const;
  Handle open_attribute(const std::string& place, const char* name) const;
  void check_storage(const Handle& set, const std::string& place, double bytes) const;
  void read_rows(const Handle& set, const std::string& place, hid_t type, std::size_t item, Size size,
                 void* data, const std::function<void(std::size_t done)>& after_block = nullptr) const;
  using Reader = std::function<herr_t(hid_t type, void* data)>;
  std::vector<std::string> read_texts(const Handle& type, const Handle& extent, const Reader& read,
                                      const std::string& place) const;

  std::string path_;
  Handle file_;
};

}  // namespace ferrobench::recordings::hdf5

// A table as an HDF5 file: one dataset for each column, in the group "table". The same table gives the same
// bytes.
#pragma once

#include <span>
#include <string>
#include <variant>
#include <vector>

namespace ferrobench::recordings {

struct FileColumn {
  std::string name;                                                    // of the dataset, without '/'
  std::string unit;                                                    // "" for none
  std::variant<std::vector<double>, std::vector<std::string>> values;  // NaN where there is none
};

// The dataset "columns" beside it has their names in their order. Replaces what
// was there once the new file is whole. Error(io_error | disk_full).
void write_columns(const std::string& path, const std::string& title, std::span<const FileColumn> columns);

}  // namespace ferrobench::recordings

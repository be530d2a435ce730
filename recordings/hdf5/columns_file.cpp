#include "recordings/hdf5/columns_file.h"

#include "recordings/format/version.h"
#include "recordings/hdf5/output.h"
#include "recordings/hdf5/target.h"

namespace ferrobench::recordings {

void write_columns(const std::string& path, const std::string& title, std::span<const FileColumn> columns) {
  NewFile file(path, Existing::replace);
  hdf5::Target target(file);
  hdf5::Output out(target.create(), path);
  out.fixed_attribute("/", "NX_class", "NXroot");
  out.fixed_attribute("/", "creator", "ferrobench");
  out.fixed_attribute("/", "creator_version", std::string(software_version()));
  out.fixed_attribute("/", "creator_commit", std::string(software_commit()));
  out.group("/table", "NXcollection");
  out.fixed_attribute("/table", "title", title);
  std::vector<std::string> names;
  for (const auto& column : columns) {
    names.push_back(column.name);
    const auto place = "/table/" + column.name;
    if (const auto* numbers = std::get_if<std::vector<double>>(&column.values))
      out.numbers(place, *numbers, "");
    else
      out.texts(place, std::get<std::vector<std::string>>(column.values));
    if (!column.unit.empty()) out.fixed_attribute(place, "units", column.unit);
  }
  out.texts("/columns", names);
  out.close();
  target.check();
  file.put();
}

}  // namespace ferrobench::recordings

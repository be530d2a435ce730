#include "recordings/hdf5/columns_file.h"

#include "recordings/format/version.h"
#include "recordings/hdf5/output.h"
#include "recordings/hdf5/target.h"

namespace ferrobench::recordings {
namespace {

hdf5::Handle create_columns(hdf5::Target& target, const std::string& path) {
  hdf5::prepare_thread();
  auto access = target.access();
  H5Pset_libver_bounds(access.get(), H5F_LIBVER_V110, H5F_LIBVER_V110);
  auto creation = hdf5::properties(H5Pcreate(H5P_FILE_CREATE));
  H5Pset_obj_track_times(creation.get(), false);
  return hdf5::file(H5Fcreate(path.c_str(), H5F_ACC_TRUNC, creation.get(), access.get()));
}

}  // namespace

void write_columns(const std::string& path, const std::string& title, std::span<const FileColumn> columns) {
  NewFile file(path, Existing::replace);
  hdf5::Target target(file);
  hdf5::Output out(create_columns(target, path), path);
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

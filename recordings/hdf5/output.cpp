#include "recordings/hdf5/output.h"

#include <cerrno>

#include "base/error.h"
#include "recordings/disk/durable_file.h"

namespace ferrobench::recordings::hdf5 {
namespace {

Handle line(std::size_t count) {
  const hsize_t size = count;
  return space(H5Screate_simple(1, &size, nullptr));
}

Handle scalar() {
  return space(H5Screate(H5S_SCALAR));
}

// Texts one after the other, each filled up to the longest.
std::pair<std::size_t, std::string> padded(std::span<const std::string> values) {
  std::size_t width = 1;
  for (const auto& value : values) width = std::max(width, value.size());
  std::string table(width * values.size(), '\0');
  for (std::size_t i = 0; i < values.size(); ++i) values[i].copy(&table[i * width], values[i].size());
  return {width, std::move(table)};
}

}  // namespace

Handle text_type(std::size_t size) {
  auto out = type(H5Tcopy(H5T_C_S1));
  H5Tset_size(out.get(), size);
  H5Tset_cset(out.get(), H5T_CSET_UTF8);
  if (size != H5T_VARIABLE) H5Tset_strpad(out.get(), H5T_STR_NULLPAD);
  return out;
}

Output::Output(Handle file, std::string path) : file_(std::move(file)), path_(std::move(path)) {
  need(static_cast<bool>(file_), "/");
}

void Output::need(bool done, const std::string& place) const {
  if (done) return;
  const bool full = is_disk_full(path_, errno);
  throw Error(full ? ErrorCode::disk_full : ErrorCode::io_error, "the recording could not be written",
              Problem{.path = place,
                      .message = "could not be written",
                      .given = path_,
                      .hint = full ? "make room on the disk" : "check that the folder can be written to"});
}

void Output::group(const std::string& place, const std::string& nx_class) {
  // Or HDF5 writes down when it was made, and the same content is never the same bytes.
  auto creation = hdf5::properties(H5Pcreate(H5P_GROUP_CREATE));
  H5Pset_obj_track_times(creation.get(), false);
  need(static_cast<bool>(
           hdf5::group(H5Gcreate2(id(), place.c_str(), H5P_DEFAULT, creation.get(), H5P_DEFAULT))),
       place);
  attribute(place, "NX_class", nx_class);
}

void Output::write(const std::string& place, const Handle& type, const Handle& space, const void* data) {
  auto properties = hdf5::properties(H5Pcreate(H5P_DATASET_CREATE));
  H5Pset_obj_track_times(properties.get(), false);
  // A small dataset inside its object header is under that header's checksum.
  const auto bytes =
      static_cast<std::size_t>(H5Sget_simple_extent_npoints(space.get())) * H5Tget_size(type.get());
  if (bytes < 32768 && H5Tis_variable_str(type.get()) <= 0) H5Pset_layout(properties.get(), H5D_COMPACT);
  const auto set = dataset(
      H5Dcreate2(id(), place.c_str(), type.get(), space.get(), H5P_DEFAULT, properties.get(), H5P_DEFAULT));
  need(set && H5Dwrite(set.get(), type.get(), H5S_ALL, H5S_ALL, H5P_DEFAULT, data) >= 0, place);
}

void Output::text(const std::string& place, const std::string& value) {
  write(place, text_type(std::max<std::size_t>(1, value.size())), scalar(), value.c_str());
}

void Output::texts(const std::string& place, std::span<const std::string> values) {
  const auto [width, table] = padded(values);
  write(place, text_type(width), line(values.size()), table.data());
}

void Output::number(const std::string& place, double value, const std::string& unit) {
  write(place, type(H5Tcopy(H5T_NATIVE_DOUBLE)), scalar(), &value);
  if (!unit.empty()) attribute(place, "units", unit);
}

void Output::integer(const std::string& place, std::int64_t value) {
  write(place, type(H5Tcopy(H5T_NATIVE_INT64)), scalar(), &value);
}

void Output::numbers(const std::string& place, std::span<const double> values, const std::string& unit) {
  write(place, type(H5Tcopy(H5T_NATIVE_DOUBLE)), line(values.size()), values.data());
  if (!unit.empty()) attribute(place, "units", unit);
}

void Output::integers(const std::string& place, std::span<const std::int64_t> values) {
  write(place, type(H5Tcopy(H5T_NATIVE_INT64)), line(values.size()), values.data());
}

void Output::annotate(const std::string& place, const char* name, const Handle& type, const Handle& space,
                      const void* data) {
  const auto made = hdf5::attribute(H5Acreate_by_name(id(), place.c_str(), name, type.get(), space.get(),
                                                      H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT));
  need(made && H5Awrite(made.get(), type.get(), data) >= 0, place + "@" + name);
}

void Output::attribute(const std::string& place, const char* name, const std::string& value) {
  const char* text = value.c_str();
  annotate(place, name, text_type(), scalar(), static_cast<const void*>(&text));
}

void Output::fixed_attribute(const std::string& place, const char* name, const std::string& value) {
  annotate(place, name, text_type(std::max<std::size_t>(1, value.size())), scalar(), value.c_str());
}

void Output::attribute(const std::string& place, const char* name, std::span<const std::string> values) {
  const auto [width, table] = padded(values);
  annotate(place, name, text_type(width), line(values.size()), table.data());
}

void Output::attribute(const std::string& place, const char* name, std::span<const double> values) {
  annotate(place, name, type(H5Tcopy(H5T_NATIVE_DOUBLE)), line(values.size()), values.data());
}

void Output::attribute(const std::string& place, const char* name, std::int64_t value) {
  annotate(place, name, type(H5Tcopy(H5T_NATIVE_INT64)), scalar(), &value);
}

void Output::flush() {
  need(H5Fflush(id(), H5F_SCOPE_LOCAL) >= 0, "/");
}

void Output::close() {
  need(file_.close(), "/");
}

}  // namespace ferrobench::recordings::hdf5

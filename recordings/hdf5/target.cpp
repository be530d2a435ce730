#include "recordings/hdf5/target.h"

#include <unistd.h>

#include <algorithm>
#include <cerrno>

#include "base/error.h"

namespace ferrobench::recordings::hdf5 {
namespace {

// HDF5 sees the first member only.
struct OpenFile {
  H5FD_t known{};
  Target* target = nullptr;
  haddr_t end = 0;  // of what HDF5 has allotted
};

OpenFile& of(H5FD_t* file) {
  return *reinterpret_cast<OpenFile*>(file);
}
const OpenFile& of(const H5FD_t* file) {
  return *reinterpret_cast<const OpenFile*>(file);
}

H5FD_t* open_target(const char*, unsigned, hid_t access, haddr_t) {
  const auto* given = static_cast<Target* const*>(H5Pget_driver_info(access));
  if (given == nullptr) return nullptr;
  auto* file = new OpenFile;
  file->target = *given;
  return &file->known;
}

herr_t close_target(H5FD_t* file) {
  delete &of(file);
  return 0;
}

herr_t query(const H5FD_t*, unsigned long* features) {
  if (features != nullptr)
    *features = H5FD_FEAT_AGGREGATE_METADATA | H5FD_FEAT_ACCUMULATE_METADATA | H5FD_FEAT_DATA_SIEVE |
                H5FD_FEAT_AGGREGATE_SMALLDATA;
  return 0;
}

haddr_t allotted(const H5FD_t* file, H5FD_mem_t) {
  return of(file).end;
}

herr_t allot(H5FD_t* file, H5FD_mem_t, haddr_t end) {
  of(file).end = end;
  return 0;
}

haddr_t size_of(const H5FD_t* file, H5FD_mem_t) {
  return of(file).target->size();
}

herr_t read_target(H5FD_t* file, H5FD_mem_t, hid_t, haddr_t place, std::size_t count, void* bytes) {
  of(file).target->read(place, static_cast<char*>(bytes), count);
  return 0;
}

herr_t write_target(H5FD_t* file, H5FD_mem_t, hid_t, haddr_t place, std::size_t count, const void* bytes) {
  of(file).target->write(place, static_cast<const char*>(bytes), count);
  return 0;
}

herr_t cut_target(H5FD_t* file, hid_t, hbool_t) {
  if (of(file).end != of(file).target->size()) of(file).target->cut(of(file).end);
  return 0;
}

hid_t driver() {
  static const hid_t id = [] {
    H5FD_class_t table{};
    table.name = "ferrobench";
    table.maxaddr = HADDR_MAX;
    table.fc_degree = H5F_CLOSE_STRONG;
    table.fapl_size = sizeof(void*);
    table.open = open_target;
    table.close = close_target;
    table.query = query;
    table.get_eoa = allotted;
    table.set_eoa = allot;
    table.get_eof = size_of;
    table.read = read_target;
    table.write = write_target;
    table.truncate = cut_target;
    constexpr H5FD_mem_t kinds[] = H5FD_FLMAP_DICHOTOMY;
    std::ranges::copy(kinds, table.fl_map);
    return H5FDregister(&table);
  }();
  return id;
}

}  // namespace

Handle Target::create() {
  prepare_thread();
  auto access = unlocked_access();
  Target* self = this;
  H5Pset_driver(access.get(), driver(), static_cast<const void*>(&self));
  H5Pset_libver_bounds(access.get(), H5F_LIBVER_V110, H5F_LIBVER_V110);
  auto creation = properties(H5Pcreate(H5P_FILE_CREATE));
  H5Pset_obj_track_times(creation.get(), false);
  return hdf5::file(H5Fcreate(file_.path().c_str(), H5F_ACC_TRUNC, creation.get(), access.get()));
}

void Target::check() const {
  if (failure_ != 0) throw_write_failure(file_.path(), failure_);
}

void Target::write(std::uint64_t place, const char* bytes, std::size_t count) {
  size_ = std::max<std::uint64_t>(size_, place + count);
  while (count > 0 && failure_ == 0) {
    const auto written = pwrite(file_.descriptor().get(), bytes, count, static_cast<off_t>(place));
    if (written < 0 && errno == EINTR) continue;
    if (written <= 0) {
      failure_ = written < 0 ? errno : EIO;
      return;
    }
    bytes += written;
    place += static_cast<std::uint64_t>(written);
    count -= static_cast<std::size_t>(written);
  }
}

void Target::read(std::uint64_t place, char* bytes, std::size_t count) {
  const auto got = read_at(file_.descriptor(), place, bytes, count);
  if (failure_ == 0) failure_ = got.failure;
  std::fill_n(bytes + got.count, count - got.count, '\0');
}

void Target::cut(std::uint64_t size) {
  size_ = size;
  while (failure_ == 0 && ftruncate(file_.descriptor().get(), static_cast<off_t>(size)) != 0)
    if (errno != EINTR) failure_ = errno;
}

}  // namespace ferrobench::recordings::hdf5

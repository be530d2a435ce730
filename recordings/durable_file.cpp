#include "recordings/durable_file.h"

#include <fcntl.h>
#include <sys/statvfs.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <filesystem>
#include <system_error>

#include "protocols/common/error.h"

namespace ferrobench::recordings {
namespace {

template <class Call>
auto repeat_interrupted(Call call) {
  auto result = call();
  while (result < 0 && errno == EINTR) result = call();
  return result;
}

struct flock whole_file(short type) {
  struct flock lock {};
  lock.l_type = type;
  lock.l_whence = SEEK_SET;
  return lock;
}

std::string folder_of(const std::string& path) {
  const auto folder = std::filesystem::path(path).parent_path();
  return folder.empty() ? "." : folder.string();
}

void sync_path(const std::string& path, int flags) {
  const auto file = open_file(path, flags);
  if (!file || repeat_interrupted([&] { return fsync(file.get()); }) != 0) throw_write_failure(path, errno);
}

}  // namespace

Descriptor::~Descriptor() {
  if (descriptor_ >= 0) close(descriptor_);
}

Descriptor open_file(const std::string& path, int flags) {
  return Descriptor(repeat_interrupted([&] { return open(path.c_str(), flags | O_CLOEXEC, 0666); }));
}

bool is_disk_full(const std::string& path, int error) {
  if (error == ENOSPC || error == EDQUOT || error == EFBIG) return true;
  struct statvfs status {};
  if (statvfs(folder_of(path).c_str(), &status) != 0) return false;
  return static_cast<double>(status.f_bavail) * static_cast<double>(status.f_frsize) < 1e6;
}

void throw_write_failure(const std::string& path, int error) {
  const bool full = is_disk_full(path, error);
  throw Error(full ? ErrorCode::disk_full : ErrorCode::io_error, "the recording could not be written",
              Problem{.message = std::generic_category().message(error),
                      .given = path,
                      .hint = full ? "make room on the disk"
                                   : "check the disk, and that the folder can be written to"});
}

void write_all(const Descriptor& file, std::string_view bytes, const std::string& path) {
  while (!bytes.empty()) {
    const auto written = repeat_interrupted([&] { return write(file.get(), bytes.data(), bytes.size()); });
    if (written < 0) throw_write_failure(path, errno);
    if (written == 0) throw_write_failure(path, EIO);
    bytes.remove_prefix(static_cast<std::size_t>(written));
  }
}

int sync_data(const Descriptor& file) {
  return repeat_interrupted([&] { return fdatasync(file.get()); }) == 0 ? 0 : errno;
}

void sync_folder_of(const std::string& path) {
  sync_path(folder_of(path), O_RDONLY | O_DIRECTORY);
}

void rename_durably(const std::string& from, const std::string& to) {
  sync_path(from, O_RDWR);
  if (repeat_interrupted([&] { return std::rename(from.c_str(), to.c_str()); }) != 0)
    throw_write_failure(to, errno);
  sync_folder_of(to);
}

// Locks of the open file, not of the process: they hold between two parts of one program as well.
bool try_lock(const Descriptor& file) {
  auto lock = whole_file(F_WRLCK);
  return repeat_interrupted([&] { return fcntl(file.get(), F_OFD_SETLK, &lock); }) == 0;
}

void wait_for_lock(const Descriptor& file, const std::string& path) {
  auto lock = whole_file(F_WRLCK);
  if (repeat_interrupted([&] { return fcntl(file.get(), F_OFD_SETLKW, &lock); }) != 0)
    throw_write_failure(path, errno);
}

bool is_locked(const Descriptor& file) {
  auto lock = whole_file(F_RDLCK);
  return fcntl(file.get(), F_OFD_GETLK, &lock) == 0 && lock.l_type != F_UNLCK;
}

}  // namespace ferrobench::recordings

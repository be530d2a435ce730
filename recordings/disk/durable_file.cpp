#include "recordings/disk/durable_file.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <sys/statvfs.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <filesystem>
#include <system_error>

#include "base/error.h"

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

void sync_path(const std::string& path, int flags) {
  const auto file = open_file(path, flags);
  if (!file || repeat_interrupted([&] { return fsync(file.get()); }) != 0) throw_write_failure(path, errno);
}

bool wait_for_lock(const Descriptor& file) {
  auto lock = whole_file(F_WRLCK);
  return repeat_interrupted([&] { return fcntl(file.get(), F_OFD_SETLKW, &lock); }) == 0;
}

// What the user can do about it.
std::string hint_for(const std::string& path, int error) {
  const auto folder = folder_of(path);
  std::error_code ignored;
  switch (error) {
    case EACCES:
    case EPERM:
      return "choose a place that you may write to, or change the permissions of " + folder;
    case EROFS:
      return "it lies on a file system that is read-only: choose another place";
    case ENOENT:
    case ENOTDIR:
      return std::filesystem::is_directory(folder, ignored)
                 ? "no file can be made in " + folder + ": choose another folder"
                 : "there is no folder " + folder + ": make it, or choose another";
    case ENAMETOOLONG:
      return "choose a shorter name";
    default:
      return "check the disk, and that the folder can be written to";
  }
}

}  // namespace

Descriptor::~Descriptor() {
  if (descriptor_ >= 0) close(descriptor_);
}

Descriptor Descriptor::duplicate() const {
  return Descriptor(fcntl(descriptor_, F_DUPFD_CLOEXEC, 0));
}

Descriptor open_file(const std::string& path, int flags) {
  return Descriptor(repeat_interrupted([&] { return open(path.c_str(), flags | O_CLOEXEC, 0666); }));
}

std::string folder_of(const std::string& path) {
  const auto folder = std::filesystem::path(path).parent_path();
  return folder.empty() ? "." : folder.string();
}

bool is_at(const std::string& path, const Descriptor& file) {
  struct stat open {
  }, named{};
  return fstat(file.get(), &open) == 0 && lstat(path.c_str(), &named) == 0 && open.st_dev == named.st_dev &&
         open.st_ino == named.st_ino;
}

// Somebody who found the file before it was locked may have taken it for a leftover and removed it.
Descriptor create_locked(const std::string& path, LockFailure failure, int flags) {
  for (;;) {
    auto file = open_file(path, O_RDWR | O_CREAT | O_EXCL | O_NOFOLLOW | flags);
    if (!file) return file;
    if (!wait_for_lock(file) && failure == LockFailure::fail) {
      const int error = errno;
      unlink(path.c_str());
      errno = error;
      return {};
    }
    if (is_at(path, file)) return file;
  }
}

// Whoever had the file locked may have put another one in its place, which somebody else may lock before this
// caller gets to it, again and again. So every caller goes through a gate, a lock of the folder, and who has
// waited in vain closes it until it is served. Where a folder cannot be locked there is no gate, and a wait
// has no bound.
Descriptor open_locked(const std::string& path) {
  const auto folder = open_file(folder_of(path), O_RDONLY | O_DIRECTORY);
  const auto gate = [&](int operation) {
    repeat_interrupted([&] { return flock(folder.get(), operation); });
  };
  gate(LOCK_EX);
  gate(LOCK_UN);
  for (;; gate(LOCK_EX)) {  // with no file held: who closed the gate may be waiting for it
    auto file = open_file(path, O_RDWR | O_NONBLOCK | O_NOFOLLOW);
    if (!file) return file;
    if (!wait_for_lock(file)) return {};
    if (is_at(path, file)) return file;
  }
}

// Where the system does not say what is wrong, a disk without room is what mostly is.
bool is_disk_full(const std::string& path, int error) {
  if (error == ENOSPC || error == EDQUOT || error == EFBIG) return true;
  struct statvfs status {};
  if (error != EIO || statvfs(folder_of(path).c_str(), &status) != 0) return false;
  return static_cast<double>(status.f_bavail) * static_cast<double>(status.f_frsize) < 1e6;
}

void throw_write_failure(const std::string& path, int error) {
  const bool full = is_disk_full(path, error);
  throw Error(full ? ErrorCode::disk_full : ErrorCode::io_error, "the file could not be written",
              Problem{.message = std::generic_category().message(error),
                      .given = path,
                      .hint = full ? "make room on the disk" : hint_for(path, error)});
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

void remove_durably(const std::string& path, const Descriptor& file) {
  if (!is_at(path, file)) return;
  if (unlink(path.c_str()) != 0 && errno != ENOENT) throw_write_failure(path, errno);
  sync_folder_of(path);
}

BytesRead read_at(const Descriptor& file, std::uint64_t place, char* to, std::size_t count) {
  BytesRead out;
  while (out.count < count) {
    const auto got = repeat_interrupted([&] {
      return pread(file.get(), to + out.count, count - out.count, static_cast<off_t>(place + out.count));
    });
    if (got < 0) out.failure = errno;
    if (got <= 0) break;
    out.count += static_cast<std::size_t>(got);
  }
  return out;
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

bool is_locked(const Descriptor& file) {
  auto lock = whole_file(F_RDLCK);
  return fcntl(file.get(), F_OFD_GETLK, &lock) == 0 && lock.l_type != F_UNLCK;
}

}  // namespace ferrobench::recordings

// Files that outlive the program and, as far as fsync goes, the power. Interrupted calls are repeated, short
// writes go on, and whatever fails is Error(disk_full) or Error(io_error) with the file's path.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <utility>

namespace ferrobench::recordings {

// Owns an open file.
class Descriptor {
 public:
  Descriptor() = default;
  explicit Descriptor(int descriptor) : descriptor_(descriptor) {}
  Descriptor(Descriptor&& other) noexcept : descriptor_(std::exchange(other.descriptor_, -1)) {}
  Descriptor& operator=(Descriptor&& other) noexcept {
    std::swap(descriptor_, other.descriptor_);
    return *this;
  }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  ~Descriptor();
  int get() const { return descriptor_; }
  explicit operator bool() const { return descriptor_ >= 0; }
  // Another one for the same open file, and the same lock. Empty, with errno, if it cannot be had.
  Descriptor duplicate() const;

 private:
  int descriptor_ = -1;
};

// Empty, with errno, if it cannot be opened.
Descriptor open_file(const std::string& path, int flags);
std::string folder_of(const std::string& path);               // "." if it names none
bool is_at(const std::string& path, const Descriptor& file);  // does the name (still) lead to this file?
// A new file that has not been there, locked (below) for as long as it is open. Empty, with errno, if it
// cannot be made. Some file systems know no locks.
enum class LockFailure { fail, ignore };
Descriptor create_locked(const std::string& path, LockFailure failure = LockFailure::fail, int flags = 0);
// The file that has the name, once nobody else has it locked. Empty, with errno, if it cannot be opened.
Descriptor open_locked(const std::string& path);
// Is a failure with this errno one of missing room where `path` lies?
bool is_disk_full(const std::string& path, int error);
[[noreturn]] void throw_write_failure(const std::string& path, int error);

void write_all(const Descriptor& file, std::string_view bytes, const std::string& path);
struct BytesRead {
  std::size_t count = 0;  // fewer than asked for only where the file ends or reading failed
  int failure = 0;        // 0 or the errno
};
BytesRead read_at(const Descriptor& file, std::uint64_t place, char* to, std::size_t count);
int sync_data(const Descriptor& file);  // 0 or the errno
// `from` gets the name `to`, replacing what had it, once all of it is on the disk; so is the name afterwards.
void rename_durably(const std::string& from, const std::string& to);
void sync_folder_of(const std::string& path);
// Takes the name away, if it (still) leads to this file.
void remove_durably(const std::string& path, const Descriptor& file);

// One holder at a time, in this process or another, and none once it has died.
bool try_lock(const Descriptor& file);   // open for writing
bool is_locked(const Descriptor& file);  // by somebody else; looking disturbs nobody

}  // namespace ferrobench::recordings

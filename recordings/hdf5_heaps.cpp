#include "recordings/hdf5_heaps.h"

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cstring>
#include <string_view>

namespace ferrobench::recordings::hdf5 {
namespace {

class MappedFile {
 public:
  explicit MappedFile(const std::string& path) {
    const int descriptor = open(path.c_str(), O_RDONLY | O_CLOEXEC);
    struct stat status {};
    if (descriptor >= 0 && fstat(descriptor, &status) == 0 && status.st_size > 0) {
      size_ = static_cast<std::size_t>(status.st_size);
      data_ = mmap(nullptr, size_, PROT_READ, MAP_PRIVATE, descriptor, 0);
    }
    if (descriptor >= 0) close(descriptor);
  }
  ~MappedFile() {
    if (data_ != MAP_FAILED) munmap(data_, size_);
  }
  MappedFile(const MappedFile&) = delete;
  MappedFile& operator=(const MappedFile&) = delete;
  std::string_view bytes() const {
    return data_ == MAP_FAILED ? std::string_view{}
                               : std::string_view(static_cast<const char*>(data_), size_);
  }

 private:
  void* data_ = MAP_FAILED;
  std::size_t size_ = 0;
};

template <class T>
T number_at(std::string_view bytes, std::size_t at) {
  T value;
  std::memcpy(&value, bytes.data() + at, sizeof value);
  return value;
}

// Head: "GCOL", version 1, 3 bytes, size (8 bytes, of it all). Objects: index (2), references (2), 4 bytes,
// size (8), then the bytes, filled up to 8; index 0 is what is free, with its own head in its size.
bool holds_together(std::string_view heap) {
  constexpr std::size_t head = 16;
  if (heap.size() < head) return false;
  const auto size = number_at<std::uint64_t>(heap, 8);
  if (size < head || size > heap.size()) return false;
  for (std::uint64_t at = head; at + head <= size;) {
    const auto bytes = number_at<std::uint64_t>(heap, at + 8);
    if (bytes > size) return false;
    const auto step = number_at<std::uint16_t>(heap, at) == 0 ? bytes : head + (bytes + 7) / 8 * 8;
    if (step < head || step > size - at) return false;
    at += step;
  }
  return true;
}

}  // namespace

std::optional<std::uint64_t> damaged_heap(const std::string& path) {
  using namespace std::string_view_literals;
  const MappedFile file(path);
  const auto bytes = file.bytes();
  for (auto at = bytes.find("GCOL\1"sv); at != std::string_view::npos; at = bytes.find("GCOL\1"sv, at + 1))
    if (!holds_together(bytes.substr(at))) return at;
  return std::nullopt;
}

}  // namespace ferrobench::recordings::hdf5

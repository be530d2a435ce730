#include "recordings/hdf5_texts.h"

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cstring>

namespace ferrobench::recordings::hdf5 {

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

namespace {

constexpr std::size_t reference_bytes = 16;

template <class T>
T number_at(std::string_view bytes, std::size_t at) {
  T value;
  std::memcpy(&value, bytes.data() + at, sizeof value);
  return value;
}

}  // namespace

// Head: "GCOL", version 1, 3 bytes, size (8 bytes, of it all). Objects: index (2), references (2), 4 bytes,
// size (8), then the bytes, filled up to 8; index 0 is what is free, with its own head in its size.
std::optional<Texts::Objects> Texts::objects_of(std::string_view heap) {
  constexpr std::size_t head = 16;
  if (heap.size() < head) return std::nullopt;
  const auto size = number_at<std::uint64_t>(heap, 8);
  if (size < head || size > heap.size()) return std::nullopt;
  Objects objects;
  for (std::uint64_t at = head; at + head <= size;) {
    const auto bytes = number_at<std::uint64_t>(heap, at + 8);
    if (bytes > size) return std::nullopt;
    const auto index = number_at<std::uint16_t>(heap, at);
    const auto step = index == 0 ? bytes : head + (bytes + 7) / 8 * 8;
    if (step < head || step > size - at) return std::nullopt;
    if (index != 0 && !objects.emplace(index, heap.substr(at + head, bytes)).second) return std::nullopt;
    at += step;
  }
  return objects;
}

Texts::Texts(const std::string& path) : file_(std::make_unique<MappedFile>(path)) {
  const auto bytes = file_->bytes();
  constexpr std::string_view mark("GCOL\1", 5);
  for (auto at = bytes.find(mark); at != std::string_view::npos; at = bytes.find(mark, at + 1))
    heaps_[at] = objects_of(bytes.substr(at)).value_or(Objects{});
}

Texts::~Texts() = default;

std::optional<std::string_view> Texts::at(std::uint64_t offset) const {
  const auto bytes = file_->bytes();
  if (bytes.size() < reference_bytes || offset > bytes.size() - reference_bytes) return std::nullopt;
  const auto length = number_at<std::uint32_t>(bytes, offset);
  const auto address = number_at<std::uint64_t>(bytes, offset + 4);
  if (address == 0 || length == 0) return std::string_view{};
  const auto heap = heaps_.find(address);
  if (heap == heaps_.end()) return std::nullopt;
  const auto object = heap->second.find(number_at<std::uint32_t>(bytes, offset + 12));
  if (object == heap->second.end() || object->second.size() != length) return std::nullopt;
  return object->second;
}

bool Texts::sound_after(std::string_view name) const {
  constexpr std::size_t reach = 256;
  const auto bytes = file_->bytes();
  for (auto at = bytes.find(name); at != std::string_view::npos; at = bytes.find(name, at + 1))
    for (std::size_t i = at + name.size(); i < at + reach && i + reference_bytes <= bytes.size(); ++i) {
      const auto heap = heaps_.find(number_at<std::uint64_t>(bytes, i + 4));
      if (heap == heaps_.end()) continue;
      const auto object = heap->second.find(number_at<std::uint32_t>(bytes, i + 12));
      if (object == heap->second.end() || object->second.size() != number_at<std::uint32_t>(bytes, i))
        return false;
    }
  return true;
}

}  // namespace ferrobench::recordings::hdf5

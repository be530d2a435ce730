// A part of a file that is sent as the body of an HTTP reply. Disks may hang: nothing of this is for the
// thread that serves everybody.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

namespace ferrobench::server {

// Bytes [first, first + length) of a file.
struct ByteRange {
  std::uint64_t first = 0;
  std::uint64_t length = 0;
};

// "bytes=5-9", "bytes=5-", "bytes=-4" within a file of `size` bytes. Length 0: outside the file. Nothing: not
// a single range, which HTTP says to ignore.
std::optional<ByteRange> parse_range(std::string_view header, std::uint64_t size);

struct FileRange : ByteRange {
  std::shared_ptr<const int> descriptor;  // closed with the last copy

  // All of a plain file; nothing if it cannot be opened, or is a link to one.
  static std::optional<FileRange> open(const std::string& path);
  // Its next bytes, at most so many, which it then no longer holds. Empty: an error, or the file became
  // shorter.
  std::string take(std::size_t most);
};

}  // namespace ferrobench::server

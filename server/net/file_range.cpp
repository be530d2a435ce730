#include "server/net/file_range.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <charconv>

namespace ferrobench::server {
namespace {

std::optional<std::uint64_t> number(std::string_view text) {
  std::uint64_t value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (text.empty() || error != std::errc{} || end != text.data() + text.size()) return std::nullopt;
  return value;
}

}  // namespace

std::optional<ByteRange> parse_range(std::string_view header, std::uint64_t size) {
  constexpr std::string_view unit = "bytes=";
  if (!header.starts_with(unit)) return std::nullopt;
  header.remove_prefix(unit.size());
  const auto dash = header.find('-');
  if (dash == std::string_view::npos) return std::nullopt;
  const auto left = number(header.substr(0, dash));
  const auto right = number(header.substr(dash + 1));
  if (dash == 0) {
    if (!right) return std::nullopt;
    const auto length = std::min(*right, size);
    return ByteRange{size - length, length};
  }
  const bool open_end = dash + 1 == header.size();
  if (!left || (!right && !open_end) || (right && *right < *left)) return std::nullopt;
  if (*left >= size) return ByteRange{};
  const auto last = open_end ? size - 1 : std::min(*right, size - 1);
  return ByteRange{*left, last - *left + 1};
}

std::optional<FileRange> FileRange::open(const std::string& path) {
  const int fd = ::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK | O_NOFOLLOW);
  if (fd < 0) return std::nullopt;
  const std::shared_ptr<const int> descriptor(new int(fd), [](const int* p) {
    close(*p);
    delete p;
  });
  struct stat info {};
  if (fstat(fd, &info) != 0 || !S_ISREG(info.st_mode)) return std::nullopt;
  FileRange whole;
  whole.length = static_cast<std::uint64_t>(info.st_size);
  whole.descriptor = descriptor;
  return whole;
}

std::string FileRange::take(std::size_t most) {
  std::string out(std::min<std::uint64_t>(length, most), '\0');
  const ssize_t got = pread(*descriptor, out.data(), out.size(), static_cast<off_t>(first));
  out.resize(static_cast<std::size_t>(std::max<ssize_t>(got, 0)));
  first += out.size();
  length -= out.size();
  return out;
}

}  // namespace ferrobench::server

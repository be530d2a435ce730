#include "base/text_file.h"

#include <fcntl.h>
#include <poll.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <system_error>

namespace ferrobench {
namespace {

struct OpenFile {
  explicit OpenFile(const std::string& path)
      : descriptor(open(path.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC | O_NOCTTY)) {}
  ~OpenFile() {
    if (descriptor >= 0) close(descriptor);
  }
  OpenFile(const OpenFile&) = delete;
  OpenFile& operator=(const OpenFile&) = delete;
  int descriptor;
};

[[noreturn]] void fail(ErrorCode code, const std::string& path, const std::string& message) {
  throw Error(code, "the file cannot be read",
              Problem{.message = message, .given = path, .hint = "name a regular file"});
}

const char* unfit(mode_t mode, Pipes pipes) {
  if (S_ISREG(mode) || (S_ISFIFO(mode) && pipes == Pipes::read)) return nullptr;
  if (S_ISDIR(mode)) return "is a folder";
  if (S_ISFIFO(mode)) return "is a pipe";
  return "is a device";
}

// Of a pipe whose writer has nothing yet, waits for more.
ssize_t read_some(int file, char* bytes, std::size_t count) {
  for (;;) {
    const auto got = read(file, bytes, count);
    if (got >= 0 || (errno != EAGAIN && errno != EINTR)) return got;
    pollfd waiting{.fd = file, .events = POLLIN, .revents = 0};
    if (errno == EAGAIN) (void)poll(&waiting, 1, -1);
  }
}

}  // namespace

std::string read_text_file(const std::string& path, std::size_t most, ErrorCode code, Pipes pipes) {
  const OpenFile file(path);
  if (file.descriptor < 0 && errno == ENOENT)
    throw Error(ErrorCode::not_found, "there is no file \"" + path + "\"");
  struct stat info {};
  if (file.descriptor < 0 || fstat(file.descriptor, &info) != 0)
    fail(ErrorCode::io_error, path, std::generic_category().message(errno));
  if (const char* what = unfit(info.st_mode, pipes)) fail(ErrorCode::not_found, path, what);
  std::string text;
  std::array<char, 1u << 16> portion{};
  for (;;) {
    const auto got = read_some(file.descriptor, portion.data(), portion.size());
    if (got < 0) fail(ErrorCode::io_error, path, std::generic_category().message(errno));
    if (got == 0) return text;
    text.append(portion.data(), static_cast<std::size_t>(got));
    if (text.size() > most)
      throw Error(code, "\"" + path + "\" is larger than " + std::to_string(most) + " bytes");
  }
}

}  // namespace ferrobench

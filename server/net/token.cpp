#include "server/net/token.h"

#include <fcntl.h>
#include <sys/random.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdlib>
#include <system_error>

#include "base/error.h"

namespace ferrobench::server {
namespace {

constexpr std::size_t digits = 64;

[[noreturn]] void fail(const std::filesystem::path& file, const std::string& what, const std::string& hint) {
  throw Error(ErrorCode::io_error, "the token file cannot be used",
              Problem{.path = "", .message = what, .given = file.string(), .hint = hint});
}

[[noreturn]] void fail_errno(const std::filesystem::path& file, int error) {
  fail(file, std::generic_category().message(error), "check the folder's permissions");
}

// Written under another name and linked, so that nobody ever reads half a token.
void create(const std::filesystem::path& file) {
  std::error_code ec;
  const auto folder = file.parent_path();
  if (!folder.empty() && std::filesystem::create_directories(folder, ec))
    std::filesystem::permissions(folder, std::filesystem::perms::owner_all, ec);
  if (ec) fail_errno(file, ec.value());
  std::string draft = file.string() + ".XXXXXX";
  const std::string text = random_secret() + "\n";
  const int fd = mkostemp(draft.data(), O_CLOEXEC);  // of mode 0600
  if (fd < 0) fail_errno(file, errno);
  const bool written =
      write(fd, text.data(), text.size()) == static_cast<ssize_t>(text.size()) && fsync(fd) == 0;
  const int write_error = errno;
  close(fd);
  const bool linked = written && (link(draft.c_str(), file.c_str()) == 0 || errno == EEXIST);
  const int link_error = written ? errno : write_error;
  unlink(draft.c_str());
  if (!linked) fail_errno(file, link_error);
}

}  // namespace

std::string random_secret() {
  std::array<unsigned char, digits / 2> bytes{};
  if (getrandom(bytes.data(), bytes.size(), 0) != static_cast<ssize_t>(bytes.size()))
    throw Error(ErrorCode::io_error, "the system gives no random bytes");
  constexpr std::string_view hex = "0123456789abcdef";
  std::string token;
  for (const unsigned char b : bytes) {
    token += hex[b >> 4];
    token += hex[b & 15];
  }
  return token;
}

std::filesystem::path state_folder() {
  if (const char* xdg = std::getenv("XDG_STATE_HOME"); xdg != nullptr && *xdg == '/')
    return std::filesystem::path(xdg) / "ferrobench";
  if (const char* home = std::getenv("HOME"); home != nullptr && *home == '/')
    return std::filesystem::path(home) / ".local/state/ferrobench";
  throw Error(ErrorCode::io_error, "no folder is known for the daemon's state",
              Problem{.path = "", .message = "HOME is not set", .hint = "set HOME or XDG_STATE_HOME"});
}

std::string load_or_create_token(const std::filesystem::path& file) {
  struct stat info {};
  if (lstat(file.c_str(), &info) != 0 && errno == ENOENT) create(file);
  return load_token(file);
}

std::string load_token(const std::filesystem::path& file) {
  const int fd = open(file.c_str(), O_RDONLY | O_NOFOLLOW | O_CLOEXEC);
  if (fd < 0) fail_errno(file, errno);
  struct stat info {};
  std::array<char, digits + 2> text{};
  const bool known = fstat(fd, &info) == 0;
  const ssize_t got = read(fd, text.data(), text.size());
  close(fd);
  if (!known || !S_ISREG(info.st_mode)) fail(file, "is not a plain file", "move it away and start again");
  if (info.st_uid != geteuid()) fail(file, "belongs to another user", "move it away and start again");
  if ((info.st_mode & 077) != 0)
    fail(file, "others may read it", "chmod 600 it, or delete it for a new token");
  const std::string_view token(text.data(), static_cast<std::size_t>(std::clamp<ssize_t>(got, 0, digits)));
  const bool fits = got == static_cast<ssize_t>(digits) ||
                    (got == static_cast<ssize_t>(digits) + 1 && text[digits] == '\n');
  if (!fits || token.find_first_not_of("0123456789abcdef") != std::string_view::npos)
    fail(file, "does not hold a token", "delete it for a new token");
  return std::string(token);
}

bool equal_secret(std::string_view a, std::string_view b) {
  if (a.size() != b.size()) return false;
  volatile unsigned char difference = 0;
  for (std::size_t i = 0; i < a.size(); ++i)
    difference = difference | static_cast<unsigned char>(a[i] ^ b[i]);
  return difference == 0;
}

}  // namespace ferrobench::server

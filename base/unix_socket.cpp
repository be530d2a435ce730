#include "base/unix_socket.h"

#include <fcntl.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <system_error>

#include "base/error.h"

namespace ferrobench {
namespace {

[[noreturn]] void fail(const std::string& path, const std::string& why, const std::string& hint) {
  throw Error(ErrorCode::io_error, "cannot listen on the Unix socket",
              Problem{.path = "/unix_socket", .message = why, .given = path, .hint = hint});
}

// Where a socket is, for bind() and connect(). They take about a hundred bytes; a longer path is named by its
// folder, which stays open meanwhile.
class Address {
 public:
  explicit Address(const std::string& path) {
    auto name = path;
    if (path.size() >= sizeof(address_.sun_path)) {
      const std::filesystem::path whole(path);
      folder_ = open(whole.parent_path().c_str(), O_PATH | O_DIRECTORY | O_CLOEXEC);
      name = "/proc/self/fd/" + std::to_string(folder_) + "/" + whole.filename().string();
    }
    if (path.empty() || name.size() >= sizeof(address_.sun_path)) {
      close_folder();
      throw Error(
          ErrorCode::invalid_params, "the socket's path cannot be used",
          Problem{.path = "/unix_socket", .message = "is empty, or its name is too long", .given = path});
    }
    address_.sun_family = AF_UNIX;
    std::memcpy(address_.sun_path, name.data(), name.size());
  }
  ~Address() { close_folder(); }
  Address(const Address&) = delete;
  Address& operator=(const Address&) = delete;

  const sockaddr* generic() const {
    return reinterpret_cast<const sockaddr*>(&address_);  // NOLINT: the socket interface asks for it
  }
  static constexpr socklen_t size = sizeof(sockaddr_un);

 private:
  void close_folder() const {
    if (folder_ >= 0) close(folder_);
  }

  sockaddr_un address_{};
  int folder_ = -1;
};

void remove_stale(const std::string& path) {
  struct stat info {};
  if (lstat(path.c_str(), &info) != 0) return;
  if (!S_ISSOCK(info.st_mode))
    fail(path, "something that is no socket is in its place", "choose another path");
  if (const int other = connect_unix(path); other >= 0) {
    close(other);
    throw Error(ErrorCode::busy, "another daemon answers on this socket",
                Problem{.path = "/unix_socket",
                        .message = "is taken",
                        .given = path,
                        .hint = "stop the other daemon, or choose another path"});
  }
  unlink(path.c_str());
}

}  // namespace

int listen_unix(const std::string& path) {
  std::error_code ignored;
  const auto folder = std::filesystem::path(path).parent_path();
  if (!folder.empty() && std::filesystem::create_directories(folder, ignored))
    std::filesystem::permissions(folder, std::filesystem::perms::owner_all, ignored);
  const Address address(path);
  remove_stale(path);
  const int fd = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  if (fd < 0) fail(path, std::generic_category().message(errno), "");
  // The mode is set before bind(), which passes it on to the file: there is no moment in which others may
  // connect.
  const bool listening = fchmod(fd, 0600) == 0 && bind(fd, address.generic(), Address::size) == 0 &&
                         chmod(path.c_str(), 0600) == 0 && listen(fd, SOMAXCONN) == 0;
  if (!listening) {
    const auto why = std::generic_category().message(errno);
    close(fd);
    fail(path, why, "check the folder's permissions");
  }
  return fd;
}

int connect_unix(const std::string& path) {
  const Address address(path);
  const int fd = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
  if (fd < 0) return -1;
  if (connect(fd, address.generic(), Address::size) == 0) return fd;
  close(fd);
  return -1;
}

bool is_trusted_peer(int socket, unsigned* user) {
  ucred peer{};
  socklen_t size = sizeof peer;
  const bool known = getsockopt(socket, SOL_SOCKET, SO_PEERCRED, &peer, &size) == 0;
  if (user != nullptr) *user = peer.uid;
  return known && (peer.uid == geteuid() || peer.uid == 0);
}

}  // namespace ferrobench

#include "usbip/server.h"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <system_error>

#include "usbip/session.h"

namespace ferrobench::emulator::usbip {

namespace {

// How long the unit's time may lag behind the clock while nothing comes from the network.
constexpr int tick_ms = 1;
// A client that takes no answers for so long is cut off.
constexpr std::size_t most_unsent = std::size_t{16} << 20;

[[noreturn]] void fail(const char* what) {
  throw std::system_error(errno, std::generic_category(), what);
}

}  // namespace

Server::Server(Emulator& emulator, std::uint16_t port)
    : emulator_(emulator), listener_(socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
  if (listener_ < 0) fail("USB/IP socket");
  const int on = 1;
  setsockopt(listener_, SOL_SOCKET, SO_REUSEADDR, &on, sizeof on);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  address.sin_port = htons(port);
  socklen_t size = sizeof address;
  auto* const any = reinterpret_cast<sockaddr*>(&address);
  if (bind(listener_, any, size) != 0 || listen(listener_, 4) != 0 ||
      getsockname(listener_, any, &size) != 0) {
    const int error = errno;
    close(listener_);
    throw std::system_error(error, std::generic_category(), "USB/IP port " + std::to_string(port));
  }
  port_ = ntohs(address.sin_port);
}

Server::~Server() {
  close(listener_);
}

void Server::run() {
  while (!stopped_) {
    pollfd waiting{.fd = listener_, .events = POLLIN, .revents = 0};
    if (poll(&waiting, 1, tick_ms) > 0) {
      const int connection = accept4(listener_, nullptr, nullptr, SOCK_CLOEXEC | SOCK_NONBLOCK);
      if (connection < 0) continue;
      serve(connection);
      close(connection);
    }
    emulator_.keep_up();
  }
}

void Server::serve(int connection) {
  const int on = 1;
  setsockopt(connection, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
  Session session(emulator_.port());
  std::vector<std::byte> unsent, chunk(65536);
  while (!stopped_) {
    const short wanted = unsent.empty() ? POLLIN : POLLIN | POLLOUT;
    pollfd waiting{.fd = connection, .events = wanted, .revents = 0};
    poll(&waiting, 1, tick_ms);
    emulator_.keep_up();
    if ((waiting.revents & (POLLIN | POLLHUP | POLLERR)) != 0) {
      const auto got = recv(connection, chunk.data(), chunk.size(), 0);
      if (got == 0 || (got < 0 && errno != EAGAIN && errno != EINTR)) return;
      if (got > 0) session.receive(std::span(chunk).first(static_cast<std::size_t>(got)));
    }
    session.collect();
    const auto more = session.take_output();
    unsent.insert(unsent.end(), more.begin(), more.end());
    if (unsent.size() > most_unsent) return;
    if (!unsent.empty()) {
      const auto sent = send(connection, unsent.data(), unsent.size(), MSG_NOSIGNAL);
      if (sent < 0 && errno != EAGAIN && errno != EINTR) return;
      if (sent > 0) unsent.erase(unsent.begin(), unsent.begin() + sent);
    }
    if (session.closed() && unsent.empty()) return;
  }
}

}  // namespace ferrobench::emulator::usbip

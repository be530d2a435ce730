// The TCP side of USB/IP: a listening socket on loopback and one connection at a time, served in real time.
#pragma once

#include <atomic>
#include <cstdint>

#include "host/emulator.h"

namespace ferrobench::emulator::usbip {

class Server {
 public:
  // Port 0: any free one. Throws std::system_error.
  Server(Emulator& emulator, std::uint16_t port);
  ~Server();
  Server(const Server&) = delete;
  Server& operator=(const Server&) = delete;

  std::uint16_t port() const { return port_; }
  // Serves one connection after the other until stop(), which may come from another thread or a signal.
  void run();
  void stop() { stopped_ = true; }

 private:
  void serve(int connection);

  Emulator& emulator_;
  int listener_;
  std::uint16_t port_ = 0;
  std::atomic<bool> stopped_ = false;
};

}  // namespace ferrobench::emulator::usbip

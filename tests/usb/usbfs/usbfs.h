// The kernel's side of a device node (usbdevfs) for one unit on a Port: transfers are submitted, discarded
// and reaped by ioctl, as libusb does. Everything that comes from the client is checked. A unit that left the
// bus and came back has another node: the old one says "no device" to all but who reaps what it had. Whoever
// opened the node reaps and discards what it submitted itself, and nothing of another one that has died.
#pragma once

#include <umockdev.h>

#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <utility>

#include "host/port.h"

namespace ferrobench::emulator {

class Usbfs {
 public:
  explicit Usbfs(Port& port) : port_(port) {}

  // A result or minus an errno. `client`: who has the node open.
  int ioctl(std::uint64_t client, unsigned long request, UMockdevIoctlData& arg);
  // Takes over what the port has finished.
  void collect();
  bool reapable() const { return !done_.empty(); }
  // The unit has left: this node is nobody's from now on.
  void retire() { retired_ = true; }
  // Once after each reset request that the unit obeyed: it comes back by itself.
  bool take_reset() { return std::exchange(reset_, false); }

 private:
  struct Unref {
    void operator()(UMockdevIoctlData* data) const { umockdev_ioctl_data_unref(data); }
  };
  using Data = std::unique_ptr<UMockdevIoctlData, Unref>;
  struct Submitted {
    Data urb;
    std::uint64_t client;
  };
  struct Done {
    Data urb;
    std::uint64_t client;
    int status;
    std::vector<std::byte> bytes;  // for the client's buffer, from `offset` on
    std::size_t offset, moved;
  };

  Outcome forward(const Request& request, std::span<const std::byte> data, std::vector<std::byte>& answer);
  bool gone() const { return retired_ || !port_.unit().on_bus(); }
  int submit(UMockdevIoctlData& arg);
  int submit_control(Data urb, std::size_t length);
  int submit_bulk(Data urb, std::uint8_t endpoint, std::size_t length);
  int discard(const UMockdevIoctlData& arg);
  int reap(UMockdevIoctlData& arg);
  int control(UMockdevIoctlData& arg);
  int clear_halt(UMockdevIoctlData& arg);
  int capabilities(UMockdevIoctlData& arg);

  Port& port_;
  bool retired_ = false;
  bool reset_ = false;
  std::uint64_t next_ = 1;
  std::uint64_t client_ = 0;  // whose call this is
  std::map<std::uint64_t, Submitted> submitted_;
  std::deque<Done> done_;
};

}  // namespace ferrobench::emulator

// A device on an emulated USB bus that an unmodified libusb finds: sysfs entries, uevents, and a device node
// whose ioctl calls come here. Only programs started under umockdev-wrapper with this environment see it.
#pragma once

#include <umockdev.h>

#include <cstdint>
#include <functional>
#include <string>

#include "unit/unit_setup.h"

namespace ferrobench::emulator {

// What a call gives back: a result (0 or more) or minus an errno. `node`: through which it came; whoever has
// that of a device that left open can still call. `client`: whoever opened it, a number for each time.
using IoctlHandler = std::function<int(const std::string& node, std::uint64_t client, unsigned long request,
                                       UMockdevIoctlData& arg)>;

class Testbed {
 public:
  // `handler` is called from a thread of its own. Throws std::runtime_error outside umockdev-wrapper.
  explicit Testbed(IoctlHandler handler);
  ~Testbed();
  Testbed(const Testbed&) = delete;
  Testbed& operator=(const Testbed&) = delete;

  void plug(const UnitSetup& setup);  // each time under a new device number
  void unplug();
  const std::string& node() const { return node_; }  // of the latest
  // Whether poll() on the node says that a transfer can be reaped.
  void set_reapable(bool reapable);

 private:
  static gboolean on_ioctl(UMockdevIoctlBase*, UMockdevIoctlClient* client, gpointer self);

  IoctlHandler handler_;
  UMockdevTestbed* testbed_;
  UMockdevIoctlBase* ioctls_ = nullptr;
  std::uintptr_t clients_ = 0;
  int number_ = 1;
  int fifo_ = -1;
  bool reapable_ = false;
  std::string syspath_, node_;
};

}  // namespace ferrobench::emulator

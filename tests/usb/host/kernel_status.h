// How the Linux kernel reports what became of a transfer, for the transports that stand in for it.
#pragma once

#include <cerrno>

#include "host/port.h"

namespace ferrobench::emulator {

// Zero or a negative errno. `cancelled`: usbfs and USB/IP have one of their own for it.
inline int kernel_status(Outcome outcome, int cancelled) {
  switch (outcome) {
    case Outcome::ok:
      return 0;
    case Outcome::stall:
      return -EPIPE;
    case Outcome::gone:
      return -ESHUTDOWN;
    case Outcome::babble:
      return -EOVERFLOW;
    case Outcome::cancelled:
      return cancelled;
  }
  return -EPROTO;
}

}  // namespace ferrobench::emulator

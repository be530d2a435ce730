// Wakes a thread that waits in poll() for something else.
#pragma once

#include <poll.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include <cstdint>

#include "recordings/disk/durable_file.h"

namespace ferrobench::bench {

class Nudge {
 public:
  // Before the next wait or in the middle of it; from any thread.
  void give() const {
    const std::uint64_t one = 1;
    [[maybe_unused]] const auto written = write(event_.get(), &one, sizeof one);
  }
  // What poll() waits for.
  pollfd wanted() const { return {event_.get(), POLLIN, 0}; }
  // After a wait: until the next one is given.
  void take() const {
    std::uint64_t given = 0;
    [[maybe_unused]] const auto taken = read(event_.get(), &given, sizeof given);
  }

 private:
  recordings::Descriptor event_{eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)};
};

}  // namespace ferrobench::bench

// Time as the driver sees it; a test puts its own in, so that no test waits.
#pragma once

#include <chrono>

namespace ferrobench::daq::usb {

class HostClock {
 public:
  using TimePoint = std::chrono::steady_clock::time_point;
  virtual ~HostClock() = default;
  virtual TimePoint now() const = 0;
  virtual void sleep_for(std::chrono::nanoseconds time) = 0;
  static HostClock& system();  // the monotonic one
};

}  // namespace ferrobench::daq::usb

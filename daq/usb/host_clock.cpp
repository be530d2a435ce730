#include "daq/usb/host_clock.h"

#include <thread>

namespace ferrobench::daq::usb {

namespace {

class SystemClock final : public HostClock {
 public:
  TimePoint now() const override { return std::chrono::steady_clock::now(); }
  void sleep_for(std::chrono::nanoseconds time) override { std::this_thread::sleep_for(time); }
};

}  // namespace

HostClock& HostClock::system() {
  static SystemClock clock;
  return clock;
}

}  // namespace ferrobench::daq::usb

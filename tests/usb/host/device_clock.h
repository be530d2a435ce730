// The driver's clock on a unit in the same process: the unit's own time, which passes while the driver waits
// or sleeps and at no other moment. With ProcessLink at pace fast a run depends on nothing but its seed.
#pragma once

#include "daq/usb/host_clock.h"
#include "host/port.h"

namespace ferrobench::emulator {

class DeviceClock final : public daq::usb::HostClock {
 public:
  explicit DeviceClock(Port& port) : port_(port) {}
  TimePoint now() const override {
    return TimePoint(std::chrono::nanoseconds(static_cast<std::int64_t>(port_.now() * 125 / 8)));
  }
  void sleep_for(std::chrono::nanoseconds time) override {
    port_.advance(port_.now() + static_cast<Ticks>(time.count()) * 8 / 125);
  }

 private:
  Port& port_;
};

}  // namespace ferrobench::emulator

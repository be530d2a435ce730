// The unit's pacer against the host's clock.
//
// n ticks at the rate asked for take (n - 1) / rate. Samples never come before they are taken, so ticks that
// are early prove a pacer that runs fast. They may come late, but the host keeps up again and again: where in
// a whole window none is in time, the pacer runs slow. Unnoticed stays a deviation below 0.05 % (crystals
// have 0.01 %), and a slow pacer until it is 50 ms late, the lag of a busy computer, through a window.
#pragma once

#include <deque>
#include <string>

#include "daq/usb/host_clock.h"

namespace ferrobench::daq::usb {

class PaceWatch {
 public:
  static constexpr double share = 5e-4;
  static constexpr double early = 0.002, late = 0.05;  // s
  static constexpr double window = 0.5;                // s

  explicit PaceWatch(double rate) : rate_(rate) {}  // of ticks, Hz

  void begin(HostClock::TimePoint before_start) { begin_ = before_start; }
  // What is wrong when `ticks` have come by `now`, or nothing.
  std::string check(std::uint64_t ticks, HostClock::TimePoint now);

 private:
  struct Arrival {
    double time = 0, lag = 0;  // s since the beginning, s behind
  };
  double rate_;
  HostClock::TimePoint begin_{};
  std::deque<Arrival> arrivals_;  // of the window, those without a later one that lags less
  double first_ = -1;             // s, the first arrival
};

}  // namespace ferrobench::daq::usb

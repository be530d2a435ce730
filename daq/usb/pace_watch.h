// The unit's pacer against the host's clock.
//
// n ticks at the rate asked for take (n - 1) / rate. Samples never come before they are taken, so ticks that
// are early prove a pacer that runs fast. They may come late, but the host keeps up again and again: where in
// a whole window none is in time, the pacer runs slow. Unnoticed stays a deviation below 0.05 % (crystals
// have 0.01 %), and a slow pacer until it is 25 ms late, the lag of a busy computer, through a window.
#pragma once

#include <limits>
#include <string>

#include "daq/usb/host_clock.h"

namespace ferrobench::daq::usb {

class PaceWatch {
 public:
  static constexpr double share = 5e-4;
  static constexpr double early = 0.002, late = 0.025;  // s
  static constexpr double window = 0.5;                 // s

  explicit PaceWatch(double rate) : rate_(rate) {}  // of ticks, Hz

  void begin(HostClock::TimePoint before_start) { begin_ = before_start; }
  // What is wrong when `ticks` have come by `now`, or nothing. `final`: nothing comes after.
  std::string check(std::uint64_t ticks, HostClock::TimePoint now, bool final = false);

 private:
  double rate_;
  HostClock::TimePoint begin_{};
  double window_end_ = window;                                   // s since the beginning
  double least_lag_ = std::numeric_limits<double>::infinity();   // s, in the window
  double lag_before_ = std::numeric_limits<double>::infinity();  // s, in the one before
};

}  // namespace ferrobench::daq::usb

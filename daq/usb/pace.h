// What the unit's pacer makes of a rate. It divides 64 MHz by a whole number; input and output tick together,
// and a row is every n-th tick, n a power of two, so that the output moves in fine steps under a slow scan.
#pragma once

#include <cstdint>

namespace ferrobench::daq::usb {

struct Pace {
  std::uint64_t period = 0;        // of the 64 MHz clock, per tick
  std::uint64_t oversampling = 1;  // ticks per row
  double tick_rate() const;        // Hz
  double row_rate() const;         // Hz
};

inline constexpr double slowest_row_rate = 1;  // Hz

// The nearest to `row_rate` [Hz] with at least `update_rate` and at most `fastest` ticks a second, the latter
// taking precedence. pace_for(p.row_rate()) has the row rate of p again. row_rate is between slowest_row_rate
// and fastest.
Pace pace_for(double row_rate, double update_rate, double fastest);

}  // namespace ferrobench::daq::usb

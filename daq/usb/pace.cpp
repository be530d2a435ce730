#include "daq/usb/pace.h"

#include <algorithm>
#include <cmath>

#include "daq/usb/models.h"

namespace ferrobench::daq::usb {

double Pace::tick_rate() const {
  return pacer_clock / static_cast<double>(period);
}

double Pace::row_rate() const {
  return pacer_clock / static_cast<double>(period * oversampling);
}

namespace {

Pace pace_of(double clocks_per_row, double update_rate, std::uint64_t shortest) {
  std::uint64_t n = 1;
  while (static_cast<double>(n) * pacer_clock < update_rate * clocks_per_row) n *= 2;
  while (n > 1 && clocks_per_row < static_cast<double>(shortest * n)) n /= 2;
  const auto nearest = std::llround(clocks_per_row / static_cast<double>(n));
  return {.period = std::max(shortest, static_cast<std::uint64_t>(nearest)), .oversampling = n};
}

}  // namespace

Pace pace_for(double row_rate, double update_rate, double fastest) {
  const auto shortest = static_cast<std::uint64_t>(std::ceil(pacer_clock / fastest * (1 - 1e-12)));
  auto pace = pace_of(static_cast<double>(std::llround(pacer_clock / row_rate)), update_rate, shortest);
  // Rounding to whole periods can cross a step of n once; a multiple of the larger one stays where it is.
  for (;;) {
    const auto again = pace_of(static_cast<double>(pace.period * pace.oversampling), update_rate, shortest);
    if (again.period * again.oversampling == pace.period * pace.oversampling) return again;
    pace = again;
  }
}

}  // namespace ferrobench::daq::usb

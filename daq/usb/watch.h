// Proof, tick by tick, that the channels are where they belong: a marker input shows its known voltage, the
// amplifier's monitor shows the field asked for.
#pragma once

#include <string>

#include "daq/usb/inputs.h"

namespace ferrobench::daq::usb {

class Watch {
 public:
  // `rate` of ticks, Hz.
  Watch(const Inputs& inputs, const std::optional<MonitorCheck>& check, double rate);

  // What is wrong in these ticks, or nothing. `levels` [V/m] are those asked for, one per tick; ticks come in
  // order and once.
  std::string check(std::uint64_t first, std::span<const std::uint16_t> codes,
                    std::span<const double> levels);

 private:
  struct Range {
    double low = 0, high = 0;
    void add(double value);
  };
  std::string check_marker(std::uint64_t first, std::span<const std::uint16_t> codes) const;
  std::string check_monitor(std::uint64_t first, std::span<const std::uint16_t> codes,
                            std::span<const double> levels);

  const Inputs& inputs_;
  std::optional<MonitorCheck> monitor_;
  // A measured level may be any that was asked for in its window of ticks and the one before.
  std::uint64_t window_;
  std::uint64_t in_window_ = 0;
  std::optional<Range> before_;
  Range now_;
};

}  // namespace ferrobench::daq::usb

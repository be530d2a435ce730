// What one unit is like and how its terminals are jumpered.
#pragma once

#include <array>
#include <cstdint>
#include <string>

#include "unit/calibration.h"
#include "unit/time_base.h"

namespace ferrobench::emulator {

// Of the port that the unit is plugged into.
enum class Speed { high, full };

enum class TriggerSource { pin, dio0, timer };
enum class ClockSource { none, input_clock_out, output_clock_out, timer };

struct Wiring {
  TriggerSource trigger = TriggerSource::pin;
  ClockSource input_clock = ClockSource::none;
  ClockSource output_clock = ClockSource::none;
  std::array<ClockSource, 2> counters{ClockSource::input_clock_out, ClockSource::output_clock_out};
};

struct UnitSetup {
  std::uint16_t product = 0x0136;   // protocol note 1
  std::uint16_t firmware = 0x0105;  // BCD
  std::string serial = "01A2B3C4";  // 8 ASCII characters
  bool fpga_loaded = false;         // the host was here since power-up
  Speed speed = Speed::high;
  std::size_t max_packet() const { return speed == Speed::high ? 512 : 64; }  // bytes, of a bulk packet
  std::uint16_t fpga_version = 0x0203;
  Calibration calibration;
  Wiring wiring;
  double temperature = 31.5;                   // deg C
  std::array<std::uint32_t, 2> counters{};     // at power-up
  Ticks output_settling = 64;                  // from the update to the new voltage at the terminal
  std::array<double, 11> internal_sources{0};  // V, by calibration source (request 0x44)
};

}  // namespace ferrobench::emulator

// The unit's own calibration, from its EEPROM, between codes and volts.
//
//   input:  volts = (slope code + offset - 32768) full scale / 32768
//   output: code  = slope (volts / 10 32768 + 32768) + offset, rounded and clamped
//
// One pair for each input range, whatever the channel; one for each output.
#pragma once

#include <array>
#include <nlohmann/json.hpp>

#include "daq/usb/unit.h"

namespace ferrobench::daq::usb {

struct CodeCorrection {
  double slope = 1;
  double offset = 0;  // codes
};

struct VoltRange {
  double low = 0, high = 0;  // V
};

struct Calibration {
  std::array<CodeCorrection, range_count> input{};
  std::array<CodeCorrection, 2> output{};

  double volts(InputRange range, double code) const;
  // Clamped to what the converter has; a NaN becomes 0 V.
  std::uint16_t code(int output_channel, double volts) const;
  double output_volts(int output_channel, double code) const;  // the other way round
  // What an output reaches, V: within its full scale, and within the codes that the converter has.
  VoltRange output_reach(int output_channel) const;
};

inline constexpr double output_full_scale = 10;  // V

// Throws Error(device_unavailable) that names address and value if a factor cannot be true: not a number, or
// outside what the vendor's own calibration stores, slopes of 0.9 to 1.2 and offsets of +-10,000 codes.
Calibration read_calibration(Unit& unit);
nlohmann::json to_json(const Calibration& calibration);

}  // namespace ferrobench::daq::usb

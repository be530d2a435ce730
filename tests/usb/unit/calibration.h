// The converters with their errors of gain and offset, and what the EEPROM says of them (protocol note 7).
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

namespace ferrobench::emulator {

// input: corrected code = slope * raw + offset; output: raw code = slope * ideal + offset.
struct CodeLine {
  float slope = 1;
  float offset = 0;
};

inline constexpr std::array<double, 4> input_full_scale{10, 5, 2, 1};  // V, by range code
inline constexpr double output_full_scale = 10;                        // V

struct Calibration {
  std::array<CodeLine, 4> input{{{1.0031F, -61.5F}, {1.0024F, -48.25F}, {0.9987F, 33.75F}, {1.0012F, 20.5F}}};
  std::array<CodeLine, 2> output{{{0.9951F, 121.5F}, {1.0043F, -97.25F}}};
};

inline std::uint16_t code_of(double value) {
  if (!(value > 0)) return 0;
  return static_cast<std::uint16_t>(std::min(std::floor(value), 65535.0));
}

// Rounded, clipped to the converter's range.
inline std::uint16_t input_code(const CodeLine& line, double full_scale, double volts) {
  const double corrected = volts * (32768 / full_scale) + 32768;
  return code_of((corrected - line.offset) / line.slope + 0.5);
}

inline double output_volts(const CodeLine& line, std::uint16_t raw) {
  return ((raw - line.offset) / line.slope - 32768) * (output_full_scale / 32768);
}

}  // namespace ferrobench::emulator

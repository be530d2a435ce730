// What is wired to the unit's terminals: its analog outputs and inputs and its eight digital lines.
#pragma once

#include "unit/time_base.h"

namespace ferrobench::emulator {

struct AnalogInput {
  unsigned channel = 0;      // 0..7 differential, 0..15 single-ended
  bool differential = true;  // terminal pair, or against ground
};

// The unit calls with times that never fall, and with the values in force from that time on.
class Board {
 public:
  virtual ~Board() = default;
  virtual void output(Ticks time, unsigned channel, double volts) = 0;
  virtual double input(Ticks time, const AnalogInput& input) = 0;  // volts
  // `driven`: lines that the unit drives; their levels are in `levels`.
  virtual void digital_out(Ticks /*time*/, std::uint8_t /*levels*/, std::uint8_t /*driven*/) {}
  virtual std::uint8_t digital_in(Ticks /*time*/) { return 0; }  // as the board would have them
};

}  // namespace ferrobench::emulator

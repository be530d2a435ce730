// The timer output (requests 0x28 and 0x2D): after `delay`, `count` pulses of `width` every `period` ticks.
#pragma once

#include <cstdint>

#include "unit/time_base.h"

namespace ferrobench::emulator {

struct TimerParameters {
  std::uint32_t period = 0, width = 0;  // ticks minus 1
  std::uint32_t count = 0;              // 0: until disabled
  std::uint32_t delay = 0;              // ticks
};

class PulseTimer {
 public:
  void set_parameters(const TimerParameters& parameters) { parameters_ = parameters; }
  const TimerParameters& parameters() const { return parameters_; }
  void set_control(std::uint8_t control, Ticks now);
  std::uint8_t control() const;
  bool level() const { return active_ != inverted_; }
  Ticks next() const { return next_; }  // of the next change of the level
  // The change that is due.
  void change();

 private:
  TimerParameters parameters_;
  bool enabled_ = false, inverted_ = false, active_ = false;
  std::uint32_t pulses_ = 0;
  Ticks pulse_begin_ = 0, next_ = never;
};

}  // namespace ferrobench::emulator

#include "unit/pulse_timer.h"

namespace ferrobench::emulator {

void PulseTimer::set_control(std::uint8_t control, Ticks now) {
  const bool enable = (control & 1U) != 0;
  inverted_ = (control & 4U) != 0;
  if (enable && !enabled_) {
    pulses_ = 0;
    pulse_begin_ = now + parameters_.delay;
    next_ = pulse_begin_;
  } else if (!enable) {
    active_ = false;
    next_ = never;
  }
  enabled_ = enable;
}

std::uint8_t PulseTimer::control() const {
  const bool running = next_ != never;
  return static_cast<std::uint8_t>((enabled_ ? 1U : 0U) | (running ? 2U : 0U) | (inverted_ ? 4U : 0U));
}

void PulseTimer::change() {
  if (!active_) {
    active_ = true;
    next_ = pulse_begin_ + parameters_.width + 1;
    return;
  }
  active_ = false;
  ++pulses_;
  if (parameters_.count != 0 && pulses_ == parameters_.count) {
    next_ = never;
    return;
  }
  // A pulse as long as its period leaves a low of one tick: an output that never falls would have no edges.
  const Ticks period =
      parameters_.period > parameters_.width ? parameters_.period + Ticks{1} : parameters_.width + Ticks{2};
  pulse_begin_ += period;
  next_ = pulse_begin_;
}

}  // namespace ferrobench::emulator

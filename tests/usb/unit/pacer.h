// When a scan's ticks come: 64 MHz / (period + 1) or an external clock, at once or from a trigger on, so many
// scans or until stopped (protocol note 4 and 5).
#pragma once

#include <cstdint>

#include "unit/time_base.h"

namespace ferrobench::emulator {

struct ScanOrder {
  std::uint32_t scans = 0;        // 0: until stopped
  std::uint32_t per_trigger = 0;  // with retriggered: scans from one trigger to waiting for the next
  std::uint32_t period = 0;       // ticks minus 1; 0: external clock
  bool triggered = false;
  bool retriggered = false;
};

class Pacer {
 public:
  // `rate_error`: the ticks come faster by this share.
  void start(const ScanOrder& order, double rate_error, Ticks now);
  void stop() { state_ = State::off; }
  void trigger(Ticks now);  // ignored unless one is awaited
  // The first tick is not before `now`: there was nothing to play.
  void restart(Ticks now);
  void halt() { next_ = never; }

  bool on() const { return state_ != State::off; }  // running or waiting for its trigger
  bool armed() const { return state_ == State::armed; }
  bool running() const { return state_ == State::running; }
  bool external() const { return order_.period == 0; }
  bool finite() const { return order_.scans != 0; }
  Ticks period() const { return period_; }                  // ticks
  Ticks next() const { return running() ? next_ : never; }  // tick of its own
  void ticked() { next_ += period_; }
  std::uint64_t scans() const { return scans_; }  // taken since START
  // True if it was the last one.
  bool scan_taken();

 private:
  enum class State { off, armed, running };
  ScanOrder order_;
  State state_ = State::off;
  Ticks period_ = 0, next_ = never;
  std::uint64_t scans_ = 0, since_trigger_ = 0;
};

}  // namespace ferrobench::emulator

#include "unit/pacer.h"

#include <algorithm>
#include <cmath>

namespace ferrobench::emulator {

void Pacer::start(const ScanOrder& order, double rate_error, Ticks now) {
  order_ = order;
  scans_ = since_trigger_ = 0;
  const double period = (static_cast<double>(order.period) + 1) / (1 + rate_error);
  period_ = static_cast<Ticks>(std::max(1.0, std::round(period)));
  state_ = State::armed;
  if (!order.triggered) trigger(now);
}

void Pacer::trigger(Ticks now) {
  if (state_ != State::armed) return;
  state_ = State::running;
  since_trigger_ = 0;
  restart(now);
}

void Pacer::restart(Ticks now) {
  next_ = external() ? never : now;
}

bool Pacer::scan_taken() {
  ++scans_;
  ++since_trigger_;
  if (finite() && scans_ == order_.scans) {
    state_ = State::off;
    return true;
  }
  if (order_.retriggered && since_trigger_ == order_.per_trigger) state_ = State::armed;
  return false;
}

}  // namespace ferrobench::emulator

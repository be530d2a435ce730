// What may pass so many times a second at most, on average. What comes a little late puts nothing off that
// follows: of events 20 ms apart, one in 33 ms passes 30 times a second, where a wait since the last one
// would let 25 pass.
#pragma once

#include <chrono>

namespace ferrobench::server {

class Pace {
 public:
  using Clock = std::chrono::steady_clock;
  explicit Pace(Clock::duration interval = {}) : interval_(interval) {}  // zero: everything passes

  bool everything() const { return interval_ == Clock::duration::zero(); }
  bool passes(Clock::time_point now) {
    if (now < due_) return false;
    due_ = now - due_ < interval_ ? due_ + interval_ : now + interval_;
    return true;
  }

 private:
  Clock::duration interval_;
  Clock::time_point due_{};
};

}  // namespace ferrobench::server

// The last line before the output: whatever is asked for, no level goes beyond the field limits and no way to
// it is steeper than the slew limit.
#pragma once

#include "daq/device.h"
#include "daq/guard/limits.h"

namespace ferrobench::daq {

class Limiter {
 public:
  // `level` is the output now, within the limits; `rate` in rows/s.
  Limiter(const Limits& limits, double rate, double level) : limits_(limits), rate_(rate), level_(level) {}

  // The level as it may go out, `samples` rows after the one before. What is not a number stays where the
  // output is.
  double pass(double wanted, std::uint64_t samples);
  double level() const { return level_; }
  // Whether the last level had to be changed by more than rounding.
  bool altered() const { return altered_; }

 private:
  Limits limits_;
  double rate_;
  double level_;
  bool altered_ = false;
};

}  // namespace ferrobench::daq

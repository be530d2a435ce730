// The last line before the output: whatever is asked for, no level passes the field limits and no piece is
// steeper than the slew limit.
#pragma once

#include "daq/device.h"
#include "daq/guard/limits.h"

namespace ferrobench::daq {

class Limiter {
 public:
  // `level` is the output now, within the limits; `rate` in rows/s.
  Limiter(const Limits& limits, double rate, double level) : limits_(limits), rate_(rate), level_(level) {}

  // The piece as it may go out. A level that is not a number stays where the output is.
  LinearPiece pass(LinearPiece wanted);
  double level() const { return level_; }
  // Whether the last piece had to be changed by more than rounding.
  bool altered() const { return altered_; }

 private:
  Limits limits_;
  double rate_;
  double level_;
  bool altered_ = false;
};

}  // namespace ferrobench::daq

#include "daq/guard/limiter.h"

#include <algorithm>
#include <cmath>

namespace ferrobench::daq {

LinearPiece Limiter::pass(LinearPiece wanted) {
  const double asked = wanted.level;
  const double step = limits_.slew * static_cast<double>(wanted.samples) / rate_;
  const double level = std::isnan(asked) ? level_ : std::clamp(asked, limits_.field_min, limits_.field_max);
  level_ = std::clamp(level, level_ - step, level_ + step);
  altered_ = !(std::abs(level_ - asked) <= 1e-9 * (limits_.field_max - limits_.field_min));
  wanted.level = level_;
  return wanted;
}

}  // namespace ferrobench::daq

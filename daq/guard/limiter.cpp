#include "daq/guard/limiter.h"

#include <algorithm>
#include <cmath>

namespace ferrobench::daq {

double Limiter::pass(double wanted, std::uint64_t samples) {
  const double step = limits_.slew * static_cast<double>(samples) / rate_;
  const double level = std::isnan(wanted) ? level_ : std::clamp(wanted, limits_.field_min, limits_.field_max);
  level_ = std::clamp(level, level_ - step, level_ + step);
  altered_ = !(std::abs(level_ - wanted) <= 1e-9 * (limits_.field_max - limits_.field_min));
  return level_;
}

}  // namespace ferrobench::daq

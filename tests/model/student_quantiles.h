// Quantiles of Student's t in closed form (Shaw 2006), at the normal score z, for what stands for them in the
// model.
#pragma once

#include <cmath>
#include <numbers>

namespace ferrobench::model {

// 4 p (1 - p) at the normal score z of p.
inline double four_p_q(double z) {
  const double below = 0.5 * std::erfc(std::abs(z) / std::numbers::sqrt2);
  return 4 * below * (1 - below);
}
inline double student_of_two(double z) {
  const double a = four_p_q(z);
  return std::copysign(std::sqrt(2 * (1 - a) / a), z);
}
inline double student_of_four(double z) {
  const double a = std::sqrt(four_p_q(z));
  return std::copysign(2 * std::sqrt(std::cos(std::acos(a) / 3) / a - 1), z);
}

}  // namespace ferrobench::model

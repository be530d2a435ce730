// First-order lag tau y' + y = u, exact for an input that goes linearly from u0 to u1 in h seconds.
#pragma once

#include <cmath>

namespace ferrobench::model {

inline double lag(double y0, double u0, double u1, double h, double tau) {
  if (h <= 0) return y0;
  if (tau <= 0) return u1;
  const double z = h / tau;
  const double decay = std::exp(-z);
  // Share of the ramp that the lag has not followed yet: (1 - e^-z) / z, without cancellation for short
  // steps.
  const double behind = -std::expm1(-z) / z;
  return u1 + (y0 - u0) * decay - (u1 - u0) * behind;
}

}  // namespace ferrobench::model

// First-order lag tau y' + y = u, exact for an input that goes linearly from u0 to u1 in h seconds.
#pragma once

#include "model/physics/dual.h"

namespace ferrobench::model {

template <class T>
T lag(const T& y0, const T& u0, const T& u1, const T& h, const T& tau) {
  if (h <= 0) return y0;
  if (tau <= 0) return u1;
  const T z = h / tau;
  const T decay = exp(-z);
  // Share of the ramp that the lag has not followed yet: (1 - e^-z) / z, without cancellation for short
  // steps.
  const T behind = -expm1(-z) / z;
  return u1 + (y0 - u0) * decay - (u1 - u0) * behind;
}

}  // namespace ferrobench::model

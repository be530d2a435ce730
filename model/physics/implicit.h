// Numbers with tangents as the simulator uses them, and the implicit function theorem on them.
//
// Besides the parameters there are directions for the unknowns of equations that are solved by iteration.
// Where x is a root of f(x, p) = 0, only its value comes from the iteration. Then everything is evaluated
// with x moving in a direction of its own, which gives df/dx beside df/dp and dy/dx beside dy/dp, and
//
//     dx/dp = -(df/dx)^-1 df/dp,   dy/dp += dy/dx dx/dp
//
// for every y that follows from x. No derivative goes through the iterations.
#pragma once

#include "model/physics/dual.h"

namespace ferrobench::model {

// Parameters that one DualNumber carries: as many as a model that is fitted to recordings has (16 to 20), so
// that the values are computed once.
inline constexpr std::size_t parameter_directions = 20;
// The unknowns at a step's end, and one of equations within that.
inline constexpr std::size_t field_direction = 20, stress_direction = 21, bend_direction = 22,
                             implicit_direction = 23;
using DualNumber = Dual<24>;

template <class T>
T unknown(double value, std::size_t direction) {
  T out(value);
  out.tangent[direction] = 1;
  return out;
}

// dx/dp of the root x of f, which moves in implicit_direction.
inline std::array<double, implicit_direction> implicit_tangents(const DualNumber& f) {
  std::array<double, implicit_direction> out{};
  const double inverse = -1 / f.tangent[implicit_direction];
  for (std::size_t i = 0; i < implicit_direction; ++i) out[i] = f.tangent[i] * inverse;
  return out;
}

// Puts the root's tangents in the place of its direction.
inline void eliminate(DualNumber& y, const std::array<double, implicit_direction>& moves) {
  const double slope = y.tangent[implicit_direction];
  for (std::size_t i = 0; i < implicit_direction; ++i) y.tangent[i] += slope * moves[i];
  y.tangent[implicit_direction] = 0;
}

// The root of f near `at`, where f rises about as its argument does: to within `enough` or as near as some
// steps lead.
template <class T, class Function>
T root(double at, double enough, const Function& f) {
  double slope = 1, last = 0, last_missing = 0;
  for (int i = 0;; ++i) {
    const double missing = value_of(f(T(at)));
    if (i > 0 && at != last) slope = (missing - last_missing) / (at - last);
    if (!(std::abs(missing) > enough) || i == 40 || !(slope > 0)) break;
    last = at;
    last_missing = missing;
    at -= missing / slope;
  }
  if constexpr (has_tangents<T>) {
    T out = unknown<T>(at, implicit_direction);
    eliminate(out, implicit_tangents(f(out)));
    return out;
  } else {
    return at;
  }
}

}  // namespace ferrobench::model

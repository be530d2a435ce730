// The barrier between two wells as a function of the driving force, for the two laws of the source.
//
// Equal curvature (4.25), dg0 the barrier at F = 0:
//
//     dg = -F                   F < -4 dg0
//        = (F/4 - dg0)^2 / dg0  |F| <= 4 dg0
//        = 0                    F > 4 dg0
//
// Unequal curvature (4.39-4.56): wells 1/2 (P - P_a)^2 / kappa_a and 1/2 (P - P_b)^2 / kappa_b, joined with
// equal slope by a concave parabola whose top lies dg0 above the wells when these are level. With D = P_a -
// P_b the driving force at a field E is F = -1/2 (kappa_a - kappa_b) E^2 - D E, and the barrier seen from a
//
//     dg = dg0 (1 - E(F) / E_a)^2,   E_a = -sqrt(2 dg0) / u,   u = (q + (kappa_a - kappa_b) / q) / 2,   q = D
//     / sqrt(2 dg0)
//
// until E passes E_a, where well a ends (dg = 0), or E_b = sqrt(2 dg0) / v, v = (q - (kappa_a - kappa_b) / q)
// / 2, where well b does (dg = -F). Other loads than the field enter through F alone.
//
// Both obey detailed balance: dg(F) of a -> b less dg(-F) of b -> a is -F. This is the plain form; the kernel
// evaluates the same for many domains at once and is tested against it.
#pragma once

#include <algorithm>
#include <cmath>
#include <type_traits>

namespace ferrobench::model {

template <class T>
T barrier_equal_curvature(const T& force, const std::type_identity_t<T>& barrier) {
  if (force < -4 * barrier) return -force;
  if (force > 4 * barrier) return 0;
  const T root = force / 4 - barrier;
  return root * root / barrier;
}

// From well a (permittivity kappa_a, polarization above that of b by `polarization` > 0) to well b. For the
// way back give the driving force of a (not its negative), and `from_b`.
inline double barrier_unequal_curvature(double force_ab, double barrier, double polarization, double kappa_a,
                                        double kappa_b, bool from_b) {
  const double difference = kappa_a - kappa_b;
  const double root = std::sqrt(2 * barrier);
  const double q = polarization / root;
  const double end_a = -root / (0.5 * (q + difference / q));
  const double end_b = root / (0.5 * (q - difference / q));
  const auto force_at = [&](double field) {
    return -0.5 * difference * field * field - polarization * field;
  };
  if (force_ab >= force_at(end_a)) return from_b ? force_ab : 0;
  if (force_ab <= force_at(end_b)) return from_b ? 0 : -force_ab;
  const double discriminant = std::max(0.0, polarization * polarization - 2 * difference * force_ab);
  const double field = -2 * force_ab / (polarization + std::sqrt(discriminant));
  const double part = 1 - field / (from_b ? end_b : end_a);
  return barrier * part * part;
}

}  // namespace ferrobench::model

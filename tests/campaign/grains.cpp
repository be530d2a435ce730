#include "tests/campaign/grains.h"

#include <algorithm>
#include <cmath>

namespace ferrobench::campaign {
namespace {

// exp(-dg / kT) with (4.25) in terms of u = F / (4 dg0); below -1 the barrier is -F.
inline __attribute__((always_inline)) double rate(const RateLaw& law, double force, double dg0) {
  const double u = 0.25 * force / dg0;
  const double inside = std::min(1.0, std::max(-1.0, u)) - 1.0;
  const double barrier = dg0 * (inside * inside + 4 * std::max(0.0, -u - 1.0));
  return std::exp(std::max(-100.0, -law.inverse_energy * barrier));
}

struct Rates {
  double a, b, c, d;  // + -> 90, 90 -> +, 90 -> -, - -> 90
};

inline __attribute__((always_inline)) Rates rates(const RateLaw& law, double barrier, double e, double s) {
  const double even =
      s * law.strain_90 - 0.5 * law.permittivity_step * e * e - 0.5 * law.compliance_step * s * s;
  const double odd = e * (law.polarization + law.piezoelectric * s);
  const double back = barrier * (1 + law.stabilization * std::max(0.0, -s));
  return {rate(law, even - odd, barrier * law.falling), rate(law, odd - even, back * law.rising),
          rate(law, -even - odd, back * law.falling), rate(law, even + odd, barrier * law.rising)};
}

}  // namespace

Grains::Grains(const Nodes& nodes)
    : barrier(nodes.barrier),
      field(nodes.field),
      stress(nodes.stress),
      weight(nodes.weight),
      plus(nodes.barrier.size(), 1.0),
      minus(nodes.barrier.size(), 0.0),
      next_plus(plus),
      next_minus(minus) {}

#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__)
__attribute__((target_clones("arch=x86-64-v4", "arch=x86-64-v3", "default")))
#endif
MeanFractions
advance(const RateLaw& given, Grains& g, double h, const LoadPoint& early, const LoadPoint& late) {
  // Copies, which no store to the fractions can change.
  const RateLaw law = given;
  const LoadPoint one = early, two = late;
  const std::size_t n = g.barrier.size();
  const double* barrier = g.barrier.data();
  const double* field = g.field.data();
  const double* stress = g.stress.data();
  const double* weight = g.weight.data();
  const double* plus = g.plus.data();
  const double* minus = g.minus.data();
  double* next_plus = g.next_plus.data();
  double* next_minus = g.next_minus.data();
  const double span = 0.5 * h * law.attempt_rate;
  double sum_plus = 0, sum_minus = 0;
#pragma GCC ivdep
  for (std::size_t i = 0; i < n; ++i) {
    const Rates first = rates(law, barrier[i], field[i] + one.field, stress[i] + one.stress);
    const Rates second = rates(law, barrier[i], field[i] + two.field, stress[i] + two.stress);
    const double a = span * (first.a + second.a), b = span * (first.b + second.b);
    const double c = span * (first.c + second.c), d = span * (first.d + second.d);
    // Eigenvalues -(m + r), -(m - r) of the chain; fractions relative to its equilibrium.
    const double out_plus = a + b, out_minus = c + d;
    const double m = 0.5 * (out_plus + out_minus), half = 0.5 * (out_minus - out_plus);
    const double r = std::max(std::sqrt(half * half + b * c), 1e-7 * m);
    const double determinant = a * c + a * d + b * d;
    const double slow = std::exp(-determinant / (m + r)), fast = std::exp(-(m + r));
    const double equal_plus = b * d / determinant, equal_minus = a * c / determinant;
    const double x = plus[i] - equal_plus, y = minus[i] - equal_minus;
    const double share = (slow - fast) / (2 * r);
    const double p = equal_plus + fast * x + share * ((half + r) * x - b * y);
    const double q = equal_minus + fast * y + share * ((r - half) * y - c * x);
    next_plus[i] = p;
    next_minus[i] = q;
    sum_plus += weight[i] * p;
    sum_minus += weight[i] * q;
  }
  return {sum_plus, sum_minus};
}

}  // namespace ferrobench::campaign

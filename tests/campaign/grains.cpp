#include "tests/campaign/grains.h"

#include <algorithm>
#include <cmath>

namespace ferrobench::campaign {
namespace {

// exp(-dg / kT) with (4.25) in terms of u = F / (4 dg0); below -1 the barrier is -F. With another exponent
// (1 - |u|)^n, and -F more where F is against it, which is the same at n = 2.
template <bool bent>
inline __attribute__((always_inline)) double rate(const RateLaw& law, double force, double dg0) {
  const double u = 0.25 * force / dg0;
  double barrier = 0;
  if constexpr (bent) {
    barrier =
        dg0 * (std::exp(law.exponent * std::log(std::max(1e-12, 1.0 - std::abs(u)))) + 4 * std::max(0.0, -u));
  } else {
    const double inside = std::min(1.0, std::max(-1.0, u)) - 1.0;
    barrier = dg0 * (inside * inside + 4 * std::max(0.0, -u - 1.0));
  }
  return std::exp(std::max(-100.0, -law.inverse_energy * barrier));
}

struct Rates {
  double a, b, c, d;    // + -> 90, 90 -> +, 90 -> -, - -> 90
  double e = 0, f = 0;  // + -> -, - -> +
};

template <bool bent, bool more>
inline __attribute__((always_inline)) Rates rates(const RateLaw& law, double barrier, double e, double s) {
  const double even =
      s * law.strain_90 - 0.5 * law.permittivity_step * e * e - 0.5 * law.compliance_step * s * s;
  const double odd = e * (law.polarization + law.piezoelectric * s);
  const double back = barrier * (1 + law.stabilization * std::max(0.0, -s));
  Rates out{rate<bent>(law, even - odd, barrier * law.falling),
            rate<bent>(law, odd - even, back * law.rising), rate<bent>(law, -even - odd, back * law.falling),
            rate<bent>(law, even + odd, barrier * law.rising)};
  if constexpr (more) {
    const double direct = barrier * law.direct_barrier;
    out.e = law.direct_rate * rate<bent>(law, -2 * odd, direct * law.falling);
    out.f = law.direct_rate * rate<bent>(law, 2 * odd, direct * law.rising);
  }
  return out;
}

template <bool bent, bool more>
inline __attribute__((always_inline)) MeanFractions advance_by(const RateLaw& given, Grains& g, double h,
                                                               const LoadPoint& early,
                                                               const LoadPoint& late) {
  // Copies, which no store to the fractions can change.
  const RateLaw law = given;
  const LoadPoint one = early, two = late;
  const std::size_t n = g.barrier.size();
  const double* barrier = g.barrier.data();
  const double* field = g.field.data();
  const double* stress = g.stress.data();
  const double* weight = g.weight.data();
  const double* pace = g.pace.data();
  const double* plus = g.plus.data();
  const double* minus = g.minus.data();
  double* next_plus = g.next_plus.data();
  double* next_minus = g.next_minus.data();
  const double mean_span = 0.5 * h * law.attempt_rate;
  double sum_plus = 0, sum_minus = 0;
#pragma GCC ivdep
  for (std::size_t i = 0; i < n; ++i) {
    const Rates first = rates<bent, more>(law, barrier[i], field[i] + one.field, stress[i] + one.stress);
    const Rates second = rates<bent, more>(law, barrier[i], field[i] + two.field, stress[i] + two.stress);
    double span = mean_span;
    if constexpr (more) span *= pace[i];
    const double a = span * (first.a + second.a), b = span * (first.b + second.b);
    const double c = span * (first.c + second.c), d = span * (first.d + second.d);
    // d(plus)/dt = b - leave_plus plus - from_minus minus, and likewise for minus.
    double leave_plus = a + b, leave_minus = c + d, from_minus = b, from_plus = c;
    double to_plus = b * d, to_minus = a * c, determinant = a * c + a * d + b * d;
    if constexpr (more) {
      const double e = span * (first.e + second.e), f = span * (first.f + second.f);
      leave_plus += e, leave_minus += f, from_minus -= f, from_plus -= e;
      to_plus += f * (b + c), to_minus += e * (b + c);
      determinant += f * (a + b + c) + e * (b + c + d);
    }
    // Eigenvalues -(m + r), -(m - r) of the chain; fractions relative to its equilibrium.
    const double m = 0.5 * (leave_plus + leave_minus), half = 0.5 * (leave_minus - leave_plus);
    const double square = half * half + from_minus * from_plus;
    const double r = std::max(std::sqrt(more ? std::max(0.0, square) : square), 1e-7 * m);
    const double slow = std::exp(-determinant / (m + r)), fast = std::exp(-(m + r));
    const double equal_plus = to_plus / determinant, equal_minus = to_minus / determinant;
    const double x = plus[i] - equal_plus, y = minus[i] - equal_minus;
    const double share = (slow - fast) / (2 * r);
    const double p = equal_plus + fast * x + share * ((half + r) * x - from_minus * y);
    const double q = equal_minus + fast * y + share * ((r - half) * y - from_plus * x);
    next_plus[i] = p;
    next_minus[i] = q;
    sum_plus += weight[i] * p;
    sum_minus += weight[i] * q;
  }
  return {sum_plus, sum_minus};
}

#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__)
#define FERROBENCH_CLONES __attribute__((target_clones("arch=x86-64-v4", "arch=x86-64-v3", "default")))
#else
#define FERROBENCH_CLONES
#endif

FERROBENCH_CLONES MeanFractions advance_plain(const RateLaw& law, Grains& g, double h, const LoadPoint& early,
                                              const LoadPoint& late) {
  return advance_by<false, false>(law, g, h, early, late);
}

FERROBENCH_CLONES MeanFractions advance_bent(const RateLaw& law, Grains& g, double h, const LoadPoint& early,
                                             const LoadPoint& late) {
  return advance_by<true, false>(law, g, h, early, late);
}

FERROBENCH_CLONES MeanFractions advance_more(const RateLaw& law, Grains& g, double h, const LoadPoint& early,
                                             const LoadPoint& late) {
  return advance_by<false, true>(law, g, h, early, late);
}

FERROBENCH_CLONES MeanFractions advance_bent_more(const RateLaw& law, Grains& g, double h,
                                                  const LoadPoint& early, const LoadPoint& late) {
  return advance_by<true, true>(law, g, h, early, late);
}

#undef FERROBENCH_CLONES

}  // namespace

Grains::Grains(const Nodes& nodes)
    : barrier(nodes.barrier),
      field(nodes.field),
      stress(nodes.stress),
      weight(nodes.weight),
      paced(!nodes.pace.empty()),
      pace(paced ? nodes.pace : std::vector<double>(nodes.barrier.size(), 1.0)),
      plus(nodes.barrier.size(), 1.0),
      minus(nodes.barrier.size(), 0.0),
      next_plus(plus),
      next_minus(minus) {}

// Each case by itself, as what a law does not have would cost time all the same.
MeanFractions advance(const RateLaw& law, Grains& g, double h, const LoadPoint& early,
                      const LoadPoint& late) {
  const bool bent = law.exponent != 2, more = law.direct_rate != 0 || g.paced;
  if (more) return (bent ? advance_bent_more : advance_more)(law, g, h, early, late);
  return (bent ? advance_bent : advance_plain)(law, g, h, early, late);
}

}  // namespace ferrobench::campaign

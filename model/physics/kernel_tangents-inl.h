// The slopes of the formulas in kernel-inl.h for a vector of rows. Included once for each instruction set, by
// kernel_tangents.cpp.
#if defined(FERROBENCH_KERNEL_TANGENTS_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef FERROBENCH_KERNEL_TANGENTS_INL
#undef FERROBENCH_KERNEL_TANGENTS_INL
#else
#define FERROBENCH_KERNEL_TANGENTS_INL
#endif

#include "model/physics/kernel-inl.h"

HWY_BEFORE_NAMESPACE();
namespace ferrobench::model::HWY_NAMESPACE {

HWY_INLINE V set(double v) {
  return hn::Set(D(), v);
}
HWY_INLINE V load(const double* p) {
  return hn::LoadU(D(), p);
}

// What moves both fractions.
struct Pair {
  V plus, minus;
};
HWY_INLINE Pair operator+(const Pair& a, const Pair& b) {
  return {a.plus + b.plus, a.minus + b.minus};
}
HWY_INLINE Pair operator*(V a, const Pair& b) {
  return {a * b.plus, a * b.minus};
}

// A barrier's derivatives.
struct BarrierSlope {
  V force;         // by the driving force of the 180 well
  V barrier;       // by dg0
  V polarization;  // by P_+ besides the force
  V permittivity;  // by half_permittivity besides the force
};

template <class Law>
struct Slopes;

template <>
struct Slopes<EqualCurvature> {
  static HWY_INLINE BarrierSlope of(const Broadcast&, V force, V dg0, V inverse, bool back) {
    const V f = back ? hn::Neg(force) : force, end = set(4.0) * dg0;
    const V root = (clamp(f, hn::Neg(end), end) * set(0.25) - dg0) * inverse;
    const V by_force = set(0.5) * root, zero = hn::Zero(D());
    return {back ? hn::Neg(by_force) : by_force, hn::Neg(root * (set(2.0) + root)), zero, zero};
  }
};

// With root^2 = 2 dg0 the ends of the wells are E_a = -4 dg0 P / (P^2 + 2 dg0 dkappa) and E_b = 4 dg0 P /
// (P^2 - 2 dg0 dkappa); the field of a driving force has dE/dF = -1 / s, s = sqrt(P^2 - 2 dkappa F) = P +
// dkappa E.
template <>
struct Slopes<UnequalCurvature> {
  static HWY_INLINE BarrierSlope of(const Broadcast& k, V force, V dg0, V inverse, bool back) {
    const V zero = hn::Zero(D()), two = set(2.0), one = set(1.0);
    const V p = k.polarization, difference = two * k.half_permittivity;
    const V s = hn::Sqrt(hn::Max(zero, p * p - two * difference * force));
    const V field = set(-2.0) * force / (p + s);
    const V turn = (back ? set(-2.0) : two) * dg0 * difference;
    const V below = p * p + turn;
    const V end = (back ? set(4.0) : set(-4.0)) * dg0 * p / below;
    const V force_a = force_at(k, set(-4.0) * dg0 * p / (p * p + two * dg0 * difference));
    const V force_b = force_at(k, set(4.0) * dg0 * p / (p * p - two * dg0 * difference));
    const V ratio = field / end, part = one - ratio;
    const V by_field = set(-2.0) * dg0 * part / end;  // d dg/dE
    const V by_end = set(2.0) * dg0 * part * ratio;   // d dg/d ln|E_end|
    const V by_root = hn::Neg(by_field) / s;          // d dg/dF
    const V sign = back ? set(-1.0) : one;
    BarrierSlope out{by_root, part * part + by_end * (inverse - sign * two * difference / below),
                     by_root * field + by_end * (one / p - two * p / below),
                     by_root * field * field - by_end * sign * set(4.0) * dg0 / below};
    const auto past_a = hn::Ge(force, force_a), past_b = hn::Le(force, force_b),
               past = hn::Or(past_a, past_b);
    // Beyond the ends dg is -F towards the lower well, or nothing.
    const V beyond =
        back ? hn::IfThenElseZero(past_a, one) : hn::IfThenElseZero(hn::AndNot(past_a, past_b), set(-1.0));
    out.force = hn::IfThenElse(past, beyond, out.force);
    for (V* v : {&out.barrier, &out.polarization, &out.permittivity}) *v = hn::IfThenZeroElse(past, *v);
    return out;
  }
  static HWY_INLINE V force_at(const Broadcast& k, V field) {
    return hn::Neg((k.half_permittivity * field + k.polarization) * field);
  }
};

// ln(rate) at one end of a step: the driving forces' own slopes, and those of the logarithms.
template <std::size_t n>
struct End {
  V field, stress, force_plus, force_minus;
  V even_by_field, even_by_stress, odd_by_field, odd_by_stress;
  BarrierSlope slope[n];
  V back_factor, back_by_stress, squeezed;  // of the stabilized barrier, squeezed = max(0, -stress)
};

template <class Law, std::size_t n>
HWY_INLINE void end_of(const Broadcast& k, const DomainColumns& domains, std::size_t i, End<n>& e) {
  const V zero = hn::Zero(D()), one = set(1.0), minus_two = set(-2.0);
  const Forces f = forces(k, domains, i);
  const V barrier = load(domains.barrier + i), inverse = load(domains.inverse_barrier + i);
  e.field = k.field + load(domains.field + i);
  e.stress = f.stress;
  e.force_plus = f.plus;
  e.force_minus = f.minus;
  e.even_by_field = minus_two * k.half_permittivity * e.field;
  e.even_by_stress = k.strain_90 + minus_two * k.half_compliance * f.stress;
  e.odd_by_field = k.polarization + k.piezoelectric * f.stress;
  e.odd_by_stress = k.piezoelectric * e.field;
  e.squeezed = hn::Max(zero, hn::Neg(f.stress));
  e.back_factor = one;
  e.back_by_stress = zero;
  V back = barrier, back_inverse = inverse;
  if (k.stabilized) {
    e.back_factor = one + k.stabilization * e.squeezed;
    e.back_by_stress = hn::IfThenElseZero(hn::Lt(f.stress, zero), hn::Neg(k.stabilization) * barrier);
    back = barrier * e.back_factor;
    back_inverse = inverse / e.back_factor;
  }
  const auto slope_of = [&](auto law, V force, V dg0, V dg0_inverse, V factor, bool from_90) HWY_ATTR {
    using Of = Slopes<decltype(law)>;
    return k.asymmetric ? Of::of(k, force, dg0 * factor, dg0_inverse / factor, from_90)
                        : Of::of(k, force, dg0, dg0_inverse, from_90);
  };
  e.slope[0] = slope_of(Law{}, f.plus, barrier, inverse, k.towards_minus, false);
  e.slope[1] = slope_of(Law{}, f.plus, back, back_inverse, k.towards_plus, true);
  e.slope[2] = slope_of(Law{}, f.minus, back, back_inverse, k.towards_minus, true);
  e.slope[3] = slope_of(Law{}, f.minus, barrier, inverse, k.towards_plus, false);
  if constexpr (n > 4) {
    const V force = f.plus - f.minus, direct = barrier * k.direct_barrier,
            direct_inverse = inverse / k.direct_barrier;
    e.slope[4] = slope_of(EqualCurvature{}, force, direct, direct_inverse, k.towards_minus, false);
    e.slope[5] = slope_of(EqualCurvature{}, force, direct, direct_inverse, k.towards_plus, true);
  }
}

// Twice the mean rate over a step (twice_mean_rate) with its slopes by ln(rate) at both ends and by twice the
// bend.
struct Transition {
  V twice_mean, before, after, twice_bend;
};

HWY_INLINE Transition transition(V l0, V l1, V r0, V r1, V twice_bend) {
  const V one = set(1.0), two = set(2.0), half = set(0.5);
  const V change = l1 - l0, sum = r0 + r1, square = change * change;
  // Below, the quotients cancel; the series in z = change / 2 are exact to 1e-12.
  const auto is_small = hn::Lt(square, set(0.01));
  const V inverse = one / hn::IfThenElse(is_small, one, change);
  const V chord = (r1 - r0) * inverse;
  const V bow = (sum - two * chord) * inverse * inverse;
  const V z = half * change, zz = z * z;
  // The rate at mid-step, sum / (2 cosh z).
  const V middle = half * sum * (one - zz * (half - zz * (set(5.0 / 24) - zz * set(61.0 / 720))));
  const V flat = middle * (set(1.0 / 6) + zz * (set(1.0 / 60) + zz * set(1.0 / 1680)));
  const V m1 = hn::IfThenElse(is_small, flat, bow);
  // By l0 and l1: of the chord (r1 - r0) / D, then of m1.
  const V chord_0 = (chord - r0) * inverse, chord_1 = (r1 - chord) * inverse;
  const V bow_0 = ((r0 - two * chord_0) * inverse + two * bow) * inverse;
  const V bow_1 = ((r1 - two * chord_1) * inverse - two * bow) * inverse;
  const V turn = half * middle * z * (set(1.0 / 30) + zz * set(1.0 / 420));
  const V m1_0 = hn::IfThenElse(is_small, half * flat - turn, bow_0);
  const V m1_1 = hn::IfThenElse(is_small, half * flat + turn, bow_1);
  const V weight = twice_bend - square, by_change = two * m1 * change;
  return {m1 * weight + sum, r0 + m1_0 * weight + by_change, r1 + m1_1 * weight - by_change, m1};
}

// A = dx'/dx, and dx'/dI of the intensities.
template <std::size_t n>
struct Propagation {
  V a[2][2];
  Pair by[n];
  V plus, minus;  // x'
};

template <std::size_t n>
HWY_INLINE Propagation<n> propagation(const PerTransition<n>& q, V plus, V minus) {
  const V one = set(1.0), two = set(2.0), zero = hn::Zero(D());
  const V a = q.v[0], b = q.v[1], c = q.v[2], e = q.v[3];
  const V ninety = one - plus - minus;
  V p = zero, m = zero;  // + -> -, - -> +
  if constexpr (n > 4) {
    p = q.v[4];
    m = q.v[5];
  }
  const V exchange = m * minus - p * plus;
  const V flow_plus = b * ninety - a * plus + exchange, flow_minus = c * ninety - e * minus - exchange;
  // M = (from_plus, b - m; c - p, from_minus)
  const V from_ninety = b + c, from_plus = a + b + p, from_minus = c + e + m, trace = from_plus + from_minus;
  const V determinant = a * (c + e) + b * e + m * (a + from_ninety) + p * (e + from_ninety);
  const V adjoint_plus = b * e + m * from_ninety - plus * determinant;
  const V adjoint_minus = a * c + p * from_ninety - minus * determinant;
  V f = zero, g = zero, f_t = zero, f_d = zero, g_t = zero, g_d = zero;
  const auto add = [&](const PolePair& pole, V real, V t, V h, V inverse) HWY_ATTR {
    const V below_t = two * (real * set(pole.slope) + t), below_d = two * real * set(pole.det_by);
    const V pf = (h * set(pole.f_det) + t * set(pole.f_trace)) * inverse;
    const V pg = (h * set(pole.g_det) + t * set(pole.g_trace)) * inverse;
    f = f + pf;
    g = g + pg;
    f_t = f_t + (set(pole.f_trace) - pf * below_t) * inverse;
    g_t = g_t + (set(pole.g_trace) - pg * below_t) * inverse;
    f_d = f_d + (set(pole.f_det * pole.det_by) - pf * below_d) * inverse;
    g_d = g_d + (set(pole.g_det * pole.det_by) - pg * below_d) * inverse;
  };
  // Two poles share a division.
  for (std::size_t first = 0; first < poles.size(); first += 2) {
    V t[2], h[2], real[2], below[2];
    for (std::size_t k = 0; k < 2; ++k) {
      const PolePair& pole = poles[first + k];
      t[k] = trace + set(pole.shift);
      h[k] = determinant * set(pole.det_by) + set(pole.det_add);
      real[k] = t[k] * set(pole.slope) + h[k];
      below[k] = real[k] * real[k] + t[k] * t[k];
    }
    const V inverse = one / (below[0] * below[1]);
    for (std::size_t k = 0; k < 2; ++k) add(poles[first + k], real[k], t[k], h[k], inverse * below[1 - k]);
  }
  const Pair by_trace{f_t * flow_plus + g_t * adjoint_plus, f_t * flow_minus + g_t * adjoint_minus};
  const Pair by_determinant{f_d * flow_plus + g_d * adjoint_plus - g * plus,
                            f_d * flow_minus + g_d * adjoint_minus - g * minus};
  // Each intensity: its part of the trace, of the determinant, of the flows and of adj(M) (b, c).
  Propagation<n> out{{{one - f * from_plus - g * determinant, f * (m - b)},
                      {f * (p - c), one - f * from_minus - g * determinant}},
                     {by_trace + from_minus * by_determinant + Pair{hn::Neg(f * plus), g * c},
                      by_trace + (e + m + p) * by_determinant + Pair{f * ninety + g * (e + m), g * p},
                      by_trace + (a + m + p) * by_determinant + Pair{g * m, f * ninety + g * (a + p)},
                      by_trace + from_plus * by_determinant + Pair{g * b, hn::Neg(f * minus)}},
                     plus,
                     minus};
  if constexpr (n > 4) {
    out.by[4] =
        by_trace + (e + from_ninety) * by_determinant + Pair{hn::Neg(f * plus), f * plus + g * from_ninety};
    out.by[5] =
        by_trace + (a + from_ninety) * by_determinant + Pair{f * minus + g * from_ninety, hn::Neg(f * minus)};
  }
  // Where a fraction is kept from leaving [0, 1] it does not move, or with the other one.
  const V next_plus = f * flow_plus + g * adjoint_plus + plus;
  const V next_minus = f * flow_minus + g * adjoint_minus + minus;
  out.plus = clamp(next_plus, zero, one);
  const V most = one - out.plus;
  out.minus = clamp(next_minus, zero, most);
  const auto plus_free = hn::And(hn::Ge(next_plus, zero), hn::Le(next_plus, one));
  const auto minus_free = hn::And(hn::Ge(next_minus, zero), hn::Le(next_minus, most));
  const auto minus_is_rest = hn::Gt(next_minus, most);
  const auto keep = [&](V& by_plus, V& by_minus) HWY_ATTR {
    by_plus = hn::IfThenElseZero(plus_free, by_plus);
    by_minus = hn::IfThenElse(minus_free, by_minus, hn::IfThenElseZero(minus_is_rest, hn::Neg(by_plus)));
  };
  keep(out.a[0][0], out.a[1][0]);
  keep(out.a[0][1], out.a[1][1]);
  for (auto& pair : out.by) keep(pair.plus, pair.minus);
  return out;
}

}  // namespace ferrobench::model::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif

// The formulas of kernel.h for a vector of rows. Included once for each instruction set, by kernel.cpp and
// kernel_tangents.cpp.
#include "model/physics/kernel.h"

#if defined(FERROBENCH_KERNEL_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef FERROBENCH_KERNEL_INL
#undef FERROBENCH_KERNEL_INL
#else
#define FERROBENCH_KERNEL_INL
#endif

#include <hwy/contrib/math/math-inl.h>
#include <hwy/highway.h>

#include <cmath>
#include <type_traits>

HWY_BEFORE_NAMESPACE();
namespace ferrobench::model::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;
using D = hn::ScalableTag<double>;
using V = hn::Vec<D>;

// Constants of one call, broadcast.
struct Broadcast {
  explicit Broadcast(const KineticConstants& k, const Loads& at)
      : field(hn::Set(D(), at.field)),
        stress(hn::Set(D(), at.stress)),
        polarization(hn::Set(D(), k.polarization)),
        strain_90(hn::Set(D(), k.strain_90)),
        piezoelectric(hn::Set(D(), k.piezoelectric)),
        half_permittivity(hn::Set(D(), k.half_permittivity)),
        half_compliance(hn::Set(D(), k.half_compliance)),
        minus_inverse_energy(hn::Set(D(), -k.inverse_energy)),
        stabilization(hn::Set(D(), k.stress_stabilization)),
        towards_plus(hn::Set(D(), k.barrier_asymmetry != 0 ? std::exp(k.barrier_asymmetry) : 1)),
        towards_minus(hn::Set(D(), k.barrier_asymmetry != 0 ? std::exp(-k.barrier_asymmetry) : 1)),
        direct_barrier(hn::Set(D(), k.direct_barrier)),
        direct_log_rate(hn::Set(D(), k.direct_rate > 0 ? std::log(k.direct_rate) : 0)),
        stabilized(k.stress_stabilization != 0),
        asymmetric(k.barrier_asymmetry != 0) {}
  V field, stress, polarization, strain_90, piezoelectric, half_permittivity, half_compliance,
      minus_inverse_energy, stabilization;
  V towards_plus, towards_minus;  // factors on the barriers
  V direct_barrier, direct_log_rate;
  bool stabilized, asymmetric;
};

// What is not a number stays so: Min and Max give their second operand then.
HWY_INLINE V clamp(V v, V low, V high) {
  return hn::Min(high, hn::Max(low, v));
}

struct EqualCurvature {
  // Barriers of a -> 90 and 90 -> a for the driving force of a.
  static HWY_INLINE void barriers(const Broadcast&, V force, V out_barrier, V inverse_out, V back_barrier,
                                  V inverse_back, V& out, V& back) {
    const V quarter = hn::Set(D(), 0.25), four = hn::Set(D(), 4.0), zero = hn::Zero(D());
    const auto one_way = [&](V f, V dg0, V inverse) HWY_ATTR {
      const V end = hn::Mul(four, dg0);
      const V root = hn::MulSub(clamp(f, hn::Neg(end), end), quarter, dg0);
      return hn::MulAdd(hn::Mul(root, root), inverse, hn::Max(zero, hn::Sub(hn::Neg(f), end)));
    };
    out = one_way(force, out_barrier, inverse_out);
    back = one_way(hn::Neg(force), back_barrier, inverse_back);
  }
};

struct UnequalCurvature {
  static HWY_INLINE void barriers(const Broadcast& k, V force, V out_barrier, V, V back_barrier, V, V& out,
                                  V& back) {
    const V half = hn::Set(D(), 0.5), two = hn::Set(D(), 2.0), zero = hn::Zero(D()), one = hn::Set(D(), 1.0);
    const V difference = hn::Mul(two, k.half_permittivity);
    const V discriminant = hn::Max(
        zero, hn::Sub(hn::Mul(k.polarization, k.polarization), hn::Mul(two, hn::Mul(difference, force))));
    const V field =
        hn::Div(hn::Mul(hn::Set(D(), -2.0), force), hn::Add(k.polarization, hn::Sqrt(discriminant)));
    // Field where well a (the 180 well) or b (the 90 well) ends, and the driving force there.
    const auto ends = [&](V dg0, V& end_a, V& end_b, V& force_a, V& force_b) HWY_ATTR {
      const V root = hn::Sqrt(hn::Mul(two, dg0));
      const V q = hn::Div(k.polarization, root);
      const V shift = hn::Div(difference, q);
      end_a = hn::Neg(hn::Div(root, hn::Mul(half, hn::Add(q, shift))));
      end_b = hn::Div(root, hn::Mul(half, hn::Sub(q, shift)));
      const auto force_at = [&](V e) HWY_ATTR {
        return hn::Neg(hn::MulAdd(hn::Mul(k.half_permittivity, e), e, hn::Mul(k.polarization, e)));
      };
      force_a = force_at(end_a);
      force_b = force_at(end_b);
    };
    V end_a, end_b, force_a, force_b;
    ends(out_barrier, end_a, end_b, force_a, force_b);
    V part = hn::Sub(one, hn::Div(field, end_a));
    out = hn::Mul(out_barrier, hn::Mul(part, part));
    out = hn::IfThenElse(hn::Ge(force, force_a), zero,
                         hn::IfThenElse(hn::Le(force, force_b), hn::Neg(force), out));
    if (k.stabilized || k.asymmetric) ends(back_barrier, end_a, end_b, force_a, force_b);
    part = hn::Sub(one, hn::Div(field, end_b));
    back = hn::Mul(back_barrier, hn::Mul(part, part));
    back = hn::IfThenElse(hn::Ge(force, force_a), force, hn::IfThenElse(hn::Le(force, force_b), zero, back));
  }
};

// Of all transitions, in the order of RateColumns: four, or six with direct switching.
template <std::size_t n>
struct PerTransition {
  V v[n];
};
// Calls act(law, number of transitions) with those of the constants, both as types.
template <class Act>
auto with_law(const KineticConstants& k, Act&& act) {
  using Four = std::integral_constant<std::size_t, most_transitions - 2>;
  using Six = std::integral_constant<std::size_t, most_transitions>;
  if (k.law == BarrierLaw::equal_curvature)
    return transition_count(k) > 4 ? act(EqualCurvature{}, Six{}) : act(EqualCurvature{}, Four{});
  return transition_count(k) > 4 ? act(UnequalCurvature{}, Six{}) : act(UnequalCurvature{}, Four{});
}

struct Forces {
  V plus, minus, stress;  // F_{+,90}, F_{-,90}, effective stress
};

HWY_INLINE Forces forces(const Broadcast& k, const DomainColumns& domains, std::size_t i) {
  const D d;
  const V field = hn::Add(k.field, hn::LoadU(d, domains.field + i));
  const V stress = hn::Add(k.stress, hn::LoadU(d, domains.stress + i));
  const V even = hn::NegMulAdd(hn::Mul(k.half_permittivity, field), field,
                               hn::Mul(stress, hn::NegMulAdd(k.half_compliance, stress, k.strain_90)));
  const V odd = hn::Mul(field, hn::MulAdd(k.piezoelectric, stress, k.polarization));
  return {hn::Sub(even, odd), hn::Add(even, odd), stress};
}

struct Barrier {
  V height, inverse;  // dg0 and 1 / dg0
};

template <class Law, std::size_t n>
HWY_INLINE PerTransition<n> log_rates(const Broadcast& k, const DomainColumns& domains, std::size_t i,
                                      const Forces& f) {
  const D d;
  const V one = hn::Set(d, 1.0), zero = hn::Zero(d);
  const V barrier = hn::LoadU(d, domains.barrier + i), inverse = hn::LoadU(d, domains.inverse_barrier + i);
  V back_barrier = barrier, back_inverse = inverse;
  if (k.stabilized) {
    const V factor = hn::MulAdd(k.stabilization, hn::Max(zero, hn::Neg(f.stress)), one);
    back_barrier = hn::Mul(barrier, factor);
    back_inverse = hn::Div(inverse, factor);
  }
  PerTransition<n> out;
  // `factor` and `back_factor` are those of the asymmetry.
  const auto between = [&](auto law, V force, Barrier away, Barrier back, V factor, V back_factor, V& l,
                           V& l_back) HWY_ATTR {
    if (k.asymmetric) {
      away = {hn::Mul(away.height, factor), hn::Div(away.inverse, factor)};
      back = {hn::Mul(back.height, back_factor), hn::Div(back.inverse, back_factor)};
    }
    decltype(law)::barriers(k, force, away.height, away.inverse, back.height, back.inverse, l, l_back);
    l = hn::Mul(l, k.minus_inverse_energy);
    l_back = hn::Mul(l_back, k.minus_inverse_energy);
  };
  const Barrier from_180{barrier, inverse}, from_90{back_barrier, back_inverse};
  between(Law{}, f.plus, from_180, from_90, k.towards_minus, k.towards_plus, out.v[0], out.v[1]);
  between(Law{}, f.minus, from_180, from_90, k.towards_plus, k.towards_minus, out.v[3], out.v[2]);
  if constexpr (n > 4) {
    const Barrier direct{hn::Mul(barrier, k.direct_barrier), hn::Div(inverse, k.direct_barrier)};
    between(EqualCurvature{}, hn::Sub(f.plus, f.minus), direct, direct, k.towards_minus, k.towards_plus,
            out.v[4], out.v[5]);
    out.v[4] = hn::Add(out.v[4], k.direct_log_rate);
    out.v[5] = hn::Add(out.v[5], k.direct_log_rate);
  }
  return out;
}

// psi of kernel.h as a sum over poles, w / (y + z). With D(z) = det + trace z + z^2, the determinant of M +
// z, and adj(M) F = G, one pole adds w (G + z F) / D(z), and it and its conjugate twice the real part of
// that: no eigenvalues, no root, and no difference of large numbers however far apart the eigenvalues are.
//
// Poles and weights are those of the least largest relative error on [0, infinity], by the exchange algorithm
// in 50 digits, with 17 equal ripples of 1.52e-8; the weights are then scaled to a sum of 1. So a fast pair
// of wells ends a step in equilibrium, as it must: a rest of 1e-8 times a rate of 1e8 would look like a flow.
struct PolePair {
  constexpr PolePair(double re, double im, double w_re, double w_im)
      : shift(2 * re),
        det_by(1 / im),
        det_add(-(re * re + im * im) / im),
        slope(re / im),
        g_det(2 * w_re / im),
        g_trace(2 * (w_re * re + w_im * im) / (im * im)),
        f_det(2 * (w_re * re - w_im * im) / im),
        f_trace(2 * w_re * (re * re + im * im) / (im * im)) {}
  double shift, det_by, det_add, slope, g_det, g_trace, f_det, f_trace;
};
constexpr double weights =
    2 * (1.6717569787908902435 - 1.2767617963796813971 + 0.10525118473506519089 - 0.00024637472328455032607);
constexpr std::array<PolePair, 4> poles{
    PolePair{3.4521686026647825543, 1.19919209208360515, 1.6717569787908902435 / weights,
             2.9124000646426563959 / weights},
    PolePair{2.5301465772181674434, 3.6145100274773414406, -1.2767617963796813971 / weights,
             -0.051964692520751249619 / weights},
    PolePair{0.51615881530984120128, 6.0977543345216061068, 0.10525118473506519089 / weights,
             -0.12226865703346698037 / weights},
    PolePair{-3.1553576596189829282, 8.7859754119085801343, -0.00024637472328455032607 / weights,
             0.0041855399749009186872 / weights}};

struct Fraction {
  V f, g, below;  // (f F + g G) / below
};

HWY_INLINE Fraction at_pole(const PolePair& pole, V trace, V determinant) {
  const D d;
  const V t = hn::Add(trace, hn::Set(d, pole.shift));
  const V h = hn::MulAdd(determinant, hn::Set(d, pole.det_by), hn::Set(d, pole.det_add));
  const V real = hn::MulAdd(t, hn::Set(d, pole.slope), h);
  return {hn::MulAdd(h, hn::Set(d, pole.f_det), hn::Mul(t, hn::Set(d, pole.f_trace))),
          hn::MulAdd(h, hn::Set(d, pole.g_det), hn::Mul(t, hn::Set(d, pole.g_trace))),
          hn::MulAdd(real, real, hn::Mul(t, t))};
}

HWY_INLINE Fraction sum(const Fraction& a, const Fraction& b) {
  return {hn::MulAdd(a.f, b.below, hn::Mul(b.f, a.below)), hn::MulAdd(a.g, b.below, hn::Mul(b.g, a.below)),
          hn::Mul(a.below, b.below)};
}

// The fractions after a step with the intensities q = {a, b, c, e} or {a, b, c, e, p, m}: they change by
// psi(M) F.
template <std::size_t n>
HWY_INLINE void propagate(const PerTransition<n>& q, V& plus, V& minus) {
  const D d;
  const V one = hn::Set(d, 1.0), zero = hn::Zero(d);
  const V a = q.v[0], b = q.v[1], c = q.v[2], e = q.v[3];
  const V ninety = hn::Sub(hn::Sub(one, plus), minus);
  V flow_plus = hn::MulSub(b, ninety, hn::Mul(a, plus));
  V flow_minus = hn::MulSub(c, ninety, hn::Mul(e, minus));
  const V from_minus = hn::Add(c, e);
  V to_plus = hn::Mul(b, e), to_minus = hn::Mul(a, c);  // adj(M) (b, c)
  V trace = hn::Add(hn::Add(a, b), from_minus);
  V determinant = hn::MulAdd(a, from_minus, to_plus);
  if constexpr (n > 4) {
    const V p = q.v[4], m = q.v[5], from_ninety = hn::Add(b, c);
    const V exchange = hn::MulSub(m, minus, hn::Mul(p, plus));
    flow_plus = hn::Add(flow_plus, exchange);
    flow_minus = hn::Sub(flow_minus, exchange);
    to_plus = hn::MulAdd(m, from_ninety, to_plus);
    to_minus = hn::MulAdd(p, from_ninety, to_minus);
    trace = hn::Add(trace, hn::Add(p, m));
    determinant = hn::MulAdd(m, hn::Add(a, from_ninety), hn::MulAdd(p, hn::Add(e, from_ninety), determinant));
  }
  const V adjoint_plus = hn::NegMulAdd(plus, determinant, to_plus);
  const V adjoint_minus = hn::NegMulAdd(minus, determinant, to_minus);
  const Fraction low = sum(at_pole(poles[0], trace, determinant), at_pole(poles[1], trace, determinant));
  const Fraction high = sum(at_pole(poles[2], trace, determinant), at_pole(poles[3], trace, determinant));
  const V low_inverse = hn::Div(one, low.below), high_inverse = hn::Div(one, high.below);
  const V f = hn::MulAdd(low.f, low_inverse, hn::Mul(high.f, high_inverse));
  const V g = hn::MulAdd(low.g, low_inverse, hn::Mul(high.g, high_inverse));
  plus = clamp(hn::MulAdd(g, adjoint_plus, hn::MulAdd(f, flow_plus, plus)), zero, one);
  minus = clamp(hn::MulAdd(g, adjoint_minus, hn::MulAdd(f, flow_minus, minus)), zero, hn::Sub(one, plus));
}

// Twice the mean of exp(l) over a step in which l goes from l0 to l1 with the bend q u (1 - u): with m1 of
// kernel.h, m0 is (r0 + r1 - m1 D^2) / 2.
HWY_INLINE V twice_mean_rate(V l0, V l1, V r0, V r1, V twice_bend) {
  const D d;
  const V change = hn::Sub(l1, l0), sum = hn::Add(r0, r1), square = hn::Mul(change, change);
  const auto is_small = hn::Lt(square, hn::Set(d, 1e-6));
  const V inverse = hn::Div(hn::Set(d, 1.0), hn::IfThenElse(is_small, hn::Set(d, 1.0), change));
  const V chord = hn::Mul(hn::Sub(r1, r0), inverse);
  const V bow = hn::Mul(hn::Mul(hn::NegMulAdd(hn::Set(d, 2.0), chord, sum), inverse), inverse);
  const V m1 = hn::IfThenElse(is_small, hn::Mul(sum, hn::Set(d, 1.0 / 12)), bow);
  return hn::MulAdd(m1, hn::Sub(twice_bend, square), sum);
}

// w of kernel.h.
HWY_INLINE V both_ways(V out, V back) {
  return hn::Mul(hn::Set(D(), 0.25), hn::Mul(out, back));
}
// Below this the rates at the end would move no fraction by what a program can show.
constexpr double least_both_ways = 1e-9;

// Twice the bend q of ln(rate) of a -> 90 (out) and 90 -> a (back) for a force that goes from f0 to f1 and is
// `bend` off the line at mid-step. With l = -(F/4 - dg0)^2 / (kT dg0) between -4 dg0 and 4 dg0; beyond, l is
// linear.
HWY_INLINE void twice_bends(const Broadcast& k, V f0, V f1, V bend, bool bent, V barrier, V inverse_barrier,
                            V& out, V& back) {
  const D d;
  const V step = hn::Sub(f1, f0), end = hn::Mul(hn::Set(d, 4.0), barrier);
  const auto inside = hn::Lt(hn::Max(hn::Abs(f0), hn::Abs(f1)), end);
  // -8 times the chord's excess over the parabola at mid-step
  const V by_square = hn::Mul(hn::Mul(k.minus_inverse_energy, hn::Set(d, -1.0 / 8)), inverse_barrier);
  out = back = hn::IfThenElseZero(inside, hn::Mul(hn::Mul(step, step), by_square));
  if (!bent) return;
  // 8 times slope times bend
  const V middle = clamp(hn::Mul(hn::Add(f0, f1), hn::Mul(hn::Set(d, 1.0 / 8), inverse_barrier)),
                         hn::Set(d, -1.0), hn::Set(d, 1.0));
  const V pushed = hn::Mul(hn::Mul(hn::Set(d, -4.0), k.minus_inverse_energy), bend);
  const V both = hn::NegMulAdd(pushed, middle, out);
  out = hn::Add(both, pushed);
  back = hn::Sub(both, pushed);
}

}  // namespace ferrobench::model::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif

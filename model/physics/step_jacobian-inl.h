// What a step of the kernel does to the fractions of a block of rows, by their start and by each cause
// (kernel_tangents.h). Included once for each instruction set, by kernel_tangents.cpp.
#if defined(FERROBENCH_STEP_JACOBIAN_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef FERROBENCH_STEP_JACOBIAN_INL
#undef FERROBENCH_STEP_JACOBIAN_INL
#else
#define FERROBENCH_STEP_JACOBIAN_INL
#endif

#include "model/physics/kernel_tangents-inl.h"
#include "model/physics/kernel_tangents.h"

HWY_BEFORE_NAMESPACE();
namespace ferrobench::model::HWY_NAMESPACE {

// Rows that are worked on at a time: what one pass leaves to the next stays near.
constexpr std::size_t block = 64;

// Of the rows of one block.
struct BlockJacobian {
  double a[4][block];
  double rate[4][block];  // weighted, of the plus rate by x+ and x-, then of the minus rate
  double cause[cause_count][2][block];
};

class Step {
 public:
  Step(const KineticConstants& k, const DomainColumns& domains, std::size_t count, const TangentStep& step)
      : k_(k),
        domains_(domains),
        count_(count),
        step_(step),
        then_(before(k, step), step.path.from),
        from_(k, step.path.from),
        to_(k, step.path.to) {}

  // `wanted`: causes that any direction has. Adds what they do to the means' rates to `rates`.
  template <class Law, std::size_t n>
  HWY_INLINE void rows(std::size_t i, std::size_t at, const std::array<bool, cause_count>& wanted,
                       BlockJacobian& out, std::array<Pair, cause_count>& rates) const;

 private:
  static KineticConstants before(KineticConstants k, const TangentStep& step) {
    k.polarization = step.polarization_before;
    return k;
  }
  const KineticConstants& k_;
  const DomainColumns& domains_;
  std::size_t count_;
  const TangentStep& step_;
  Broadcast then_, from_, to_;  // as the rates before were made, and as this step sees both ends
};

template <class Law, std::size_t n>
HWY_INLINE void Step::rows(std::size_t i, std::size_t at, const std::array<bool, cause_count>& wanted,
                           BlockJacobian& out, std::array<Pair, cause_count>& rates) const {
  const D d;
  const V zero = hn::Zero(d), one = set(1.0);
  End<n> ends[2];
  end_of<Law>(then_, domains_, i, ends[0]);
  end_of<Law>(to_, domains_, i, ends[1]);
  const End<n>&start = ends[0], &end = ends[1];
  const Forces from = forces(from_, domains_, i);
  const V barrier = load(domains_.barrier + i), inverse_barrier = load(domains_.inverse_barrier + i);

  // Bends as in step_with, of F_{+,90}, of F_{-,90} and of what is between + and -.
  const V bend_even = set(step_.path.bend.stress) * to_.strain_90;
  const V bend_odd = set(step_.path.bend.field) * to_.polarization;
  const bool bent = step_.path.bend.stress != 0 || step_.path.bend.field != 0;
  PerTransition<n> bend;
  twice_bends(to_, from.plus, end.force_plus, bend_even - bend_odd, bent, barrier, inverse_barrier, bend.v[0],
              bend.v[1]);
  twice_bends(to_, from.minus, end.force_minus, bend_even + bend_odd, bent, barrier, inverse_barrier,
              bend.v[3], bend.v[2]);
  const V direct = barrier * to_.direct_barrier, direct_inverse = inverse_barrier / to_.direct_barrier;
  if constexpr (n > 4)
    twice_bends(to_, from.plus - from.minus, end.force_plus - end.force_minus, set(-2.0) * bend_odd, bent,
                direct, direct_inverse, bend.v[4], bend.v[5]);

  const V half_span = set(0.5 * step_.h / k_.relaxation_time);
  PerTransition<n> l0, l1, rate, of_mean, intensity, end_share;
  Transition mean[n];
  for (std::size_t j = 0; j < n; ++j) {
    l0.v[j] = load(step_.before.log_rate[j] + i);
    l1.v[j] = load(step_.after.log_rate[j] + i);
    rate.v[j] = load(step_.after.rate[j] + i);
    mean[j] = transition(l0.v[j], l1.v[j], load(step_.before.rate[j] + i), rate.v[j], bend.v[j]);
    of_mean.v[j] = half_span * mean[j].twice_mean;
  }
  const auto at_end = [&](std::size_t j) HWY_ATTR { return set(2.0) * half_span * rate.v[j]; };
  for (std::size_t j = 0; j < n; ++j) {
    const V w = both_ways(of_mean.v[j], of_mean.v[j ^ 1]);
    end_share.v[j] = hn::IfThenElseZero(hn::Ge(w, set(least_both_ways)), w / (one + w));
    intensity.v[j] = of_mean.v[j] + end_share.v[j] * (at_end(j) - of_mean.v[j]);
  }
  const Propagation<n> p = propagation(intensity, load(domains_.plus + i), load(domains_.minus + i));
  const V weight = hn::IfThenElseZero(hn::FirstN(d, count_ - i), load(domains_.weight + i));
  hn::StoreU(p.a[0][0], d, out.a[0] + at);
  hn::StoreU(p.a[0][1], d, out.a[1] + at);
  hn::StoreU(p.a[1][0], d, out.a[2] + at);
  hn::StoreU(p.a[1][1], d, out.a[3] + at);
  V to_minus = zero, to_plus = zero;
  if constexpr (n > 4) {
    to_minus = rate.v[4];
    to_plus = rate.v[5];
  }
  hn::StoreU(hn::Neg(weight * (rate.v[0] + rate.v[1] + to_minus)), d, out.rate[0] + at);
  hn::StoreU(weight * (to_plus - rate.v[1]), d, out.rate[1] + at);
  hn::StoreU(weight * (to_minus - rate.v[2]), d, out.rate[2] + at);
  hn::StoreU(hn::Neg(weight * (rate.v[2] + rate.v[3] + to_plus)), d, out.rate[3] + at);

  // x' by ln(rate) at both ends and by the bends; the means' weighted rates at the end by ln(rate) there.
  Pair x0[n], x1[n], xb[n], flow[n], by_span = {zero, zero};
  for (std::size_t j = 0; j < n; ++j) {
    const std::size_t back = j ^ 1;
    const V share = end_share.v[j], rest = one - share;
    // By w, of which the share is w / (1 + w).
    const Pair by_both_ways =
        rest * ((at_end(j) - intensity.v[j]) * p.by[j] + (at_end(back) - intensity.v[back]) * p.by[back]);
    const V open = hn::IfThenElseZero(hn::Gt(share, zero), set(0.25) * of_mean.v[back]);
    const Pair by_mean = rest * p.by[j] + open * by_both_ways, by_end = (share * at_end(j)) * p.by[j];
    const Pair by = half_span * by_mean;
    x0[j] = mean[j].before * by;
    x1[j] = mean[j].after * by + by_end;
    xb[j] = mean[j].twice_bend * by;
    by_span = by_span + of_mean.v[j] * by_mean + by_end;
  }
  const V ninety = weight * (one - p.plus - p.minus);
  flow[0] = {hn::Neg(rate.v[0] * (weight * p.plus)), zero};
  flow[1] = {rate.v[1] * ninety, zero};
  flow[2] = {zero, rate.v[2] * ninety};
  flow[3] = {zero, hn::Neg(rate.v[3] * (weight * p.minus))};
  if constexpr (n > 4) {
    const V leaves_plus = rate.v[4] * (weight * p.plus), leaves_minus = rate.v[5] * (weight * p.minus);
    flow[4] = {hn::Neg(leaves_plus), leaves_plus};
    flow[5] = {leaves_minus, hn::Neg(leaves_minus)};
  }

  // By the driving forces: at the start through ln(rate) and through the bend, at the end through both, at
  // mid-step.
  const V energy = to_.minus_inverse_energy, push = set(-4.0) * energy;
  constexpr std::size_t sides = n / 2;  // F_{+,90}, F_{-,90}, and their difference
  Pair old_force[sides], start_force[sides], end_force[sides], bend_force[sides], rate_force[sides];
  Pair all_start[sides], bend_barrier = {zero, zero}, direct_bend_barrier = {zero, zero};  // by ln(dg0)
  const auto side = [&](int s, int out_j, int back_j, V f0, V f1, V force_bend, V dg0,
                        V dg0_inverse) HWY_ATTR {
    const V by_square = energy * set(-1.0 / 8) * dg0_inverse, eighth = set(1.0 / 8) * dg0_inverse;
    const V limit = set(4.0) * dg0;
    const Pair both = xb[out_j] + xb[back_j];
    const V moved = f1 - f0;
    const auto inside = hn::Lt(hn::Max(hn::Abs(f0), hn::Abs(f1)), limit);
    const V by_moved = hn::IfThenElseZero(inside, set(2.0) * by_square * moved);
    V by_sum = zero, middle = zero;
    if (bent) {
      const V raw = (f0 + f1) * eighth;
      middle = clamp(raw, set(-1.0), one);
      by_sum = hn::IfThenElseZero(hn::Lt(hn::Abs(raw), one), hn::Neg(push * force_bend) * eighth);
    }
    (s < 2 ? bend_barrier : direct_bend_barrier) =
        (s < 2 ? bend_barrier : direct_bend_barrier) +
        hn::Neg(set(0.5) * by_moved * moved + by_sum * (f0 + f1)) * both;
    old_force[s] =
        energy * start.slope[out_j].force * x0[out_j] + energy * start.slope[back_j].force * x0[back_j];
    start_force[s] = (by_sum - by_moved) * both;
    end_force[s] = energy * end.slope[out_j].force * x1[out_j] +
                   energy * end.slope[back_j].force * x1[back_j] + (by_sum + by_moved) * both;
    bend_force[s] = push * (one - middle) * xb[out_j] + hn::Neg(push * (one + middle)) * xb[back_j];
    rate_force[s] =
        energy * end.slope[out_j].force * flow[out_j] + energy * end.slope[back_j].force * flow[back_j];
    all_start[s] = old_force[s] + start_force[s];
  };
  side(0, 0, 1, from.plus, end.force_plus, bend_even - bend_odd, barrier, inverse_barrier);
  side(1, 3, 2, from.minus, end.force_minus, bend_even + bend_odd, barrier, inverse_barrier);
  if constexpr (n > 4)
    side(2, 4, 5, from.plus - from.minus, end.force_plus - end.force_minus, set(-2.0) * bend_odd, direct,
         direct_inverse);

  const auto is_wanted = [&](Cause cause) HWY_ATTR { return wanted[static_cast<std::size_t>(cause)]; };
  const auto put = [&](Cause cause, const Pair& x, const Pair& rate_by) HWY_ATTR {
    const auto c = static_cast<std::size_t>(cause);
    hn::StoreU(x.plus, d, out.cause[c][0] + at);
    hn::StoreU(x.minus, d, out.cause[c][1] + at);
    rates[c] = rates[c] + rate_by;
  };
  const Pair none{zero, zero};
  // By the even and odd part of the forces.
  const auto x_by = [&](const Pair* force, V even, V odd) HWY_ATTR {
    const Pair by_90 = (even - odd) * force[0] + (even + odd) * force[1];
    if constexpr (n > 4)
      return by_90 + set(-2.0) * odd * force[2];
    else
      return by_90;
  };
  const auto rate_by = [&](V even, V odd) HWY_ATTR { return x_by(rate_force, even, odd); };

  // By the loads.
  const Pair field_0 = x_by(all_start, start.even_by_field, start.odd_by_field);
  const Pair field_1 = x_by(end_force, end.even_by_field, end.odd_by_field);
  const Pair rate_field = rate_by(end.even_by_field, end.odd_by_field);
  Pair stress_0 = x_by(all_start, start.even_by_stress, start.odd_by_stress);
  Pair stress_1 = x_by(end_force, end.even_by_stress, end.odd_by_stress);
  Pair rate_stress = rate_by(end.even_by_stress, end.odd_by_stress);
  // By the barriers of 90 -> +/-180.
  const auto back_by = [&](const End<n>& e, const Pair* x) HWY_ATTR {
    return energy * to_.towards_plus * e.slope[1].barrier * x[1] +
           energy * to_.towards_minus * e.slope[2].barrier * x[2];
  };
  const Pair back_0 = back_by(start, x0), back_1 = back_by(end, x1), rate_back = back_by(end, flow);
  if (to_.stabilized) {
    stress_0 = stress_0 + start.back_by_stress * back_0;
    stress_1 = stress_1 + end.back_by_stress * back_1;
    rate_stress = rate_stress + end.back_by_stress * rate_back;
  }
  if (is_wanted(Cause::field_before)) put(Cause::field_before, field_0, none);
  if (is_wanted(Cause::field_after)) put(Cause::field_after, field_1, rate_field);
  if (is_wanted(Cause::stress_before)) put(Cause::stress_before, stress_0, none);
  if (is_wanted(Cause::stress_after)) put(Cause::stress_after, stress_1, rate_stress);
  if (is_wanted(Cause::bend)) put(Cause::bend, to_.strain_90 * (bend_force[0] + bend_force[1]), none);
  if (is_wanted(Cause::internal_field)) put(Cause::internal_field, field_0 + field_1, rate_field);
  if (is_wanted(Cause::internal_field_std)) {
    const V z = load(step_.quantile[1] + i);
    put(Cause::internal_field_std, z * (field_0 + field_1), z * rate_field);
  }
  if (is_wanted(Cause::internal_stress_std)) {
    const V z = load(step_.quantile[2] + i);
    put(Cause::internal_stress_std, z * (stress_0 + stress_1), z * rate_stress);
  }

  // By the constants. A law's own slopes, besides those through the forces:
  const auto law_by = [&](V BarrierSlope::*member, const End<n>& e, const Pair* x) HWY_ATTR {
    return energy * (e.slope[0].*member * x[0] + e.slope[1].*member * x[1] + e.slope[2].*member * x[2] +
                     e.slope[3].*member * x[3]);
  };
  if (is_wanted(Cause::polarization_before))
    put(Cause::polarization_before,
        x_by(old_force, zero, start.field) + law_by(&BarrierSlope::polarization, start, x0), none);
  if (is_wanted(Cause::polarization_after))  // the bend knows no other P_+
    put(Cause::polarization_after,
        x_by(start_force, zero, start.field) + x_by(end_force, zero, end.field) +
            law_by(&BarrierSlope::polarization, end, x1),
        rate_by(zero, end.field) + law_by(&BarrierSlope::polarization, end, flow));
  if (is_wanted(Cause::strain_90))
    put(Cause::strain_90,
        x_by(all_start, start.stress, zero) + x_by(end_force, end.stress, zero) +
            set(step_.path.bend.stress) * (bend_force[0] + bend_force[1]),
        rate_by(end.stress, zero));
  if (is_wanted(Cause::piezoelectric)) {
    const V odd_0 = start.field * start.stress, odd_1 = end.field * end.stress;
    put(Cause::piezoelectric, x_by(all_start, zero, odd_0) + x_by(end_force, zero, odd_1),
        rate_by(zero, odd_1));
  }
  if (is_wanted(Cause::half_permittivity)) {
    const V even_0 = hn::Neg(start.field * start.field), even_1 = hn::Neg(end.field * end.field);
    put(Cause::half_permittivity,
        x_by(all_start, even_0, zero) + x_by(end_force, even_1, zero) +
            law_by(&BarrierSlope::permittivity, start, x0) + law_by(&BarrierSlope::permittivity, end, x1),
        rate_by(even_1, zero) + law_by(&BarrierSlope::permittivity, end, flow));
  }
  if (is_wanted(Cause::half_compliance)) {
    const V even_0 = hn::Neg(start.stress * start.stress), even_1 = hn::Neg(end.stress * end.stress);
    put(Cause::half_compliance, x_by(all_start, even_0, zero) + x_by(end_force, even_1, zero),
        rate_by(even_1, zero));
  }
  if (is_wanted(Cause::log_energy)) {
    Pair x = none, rate_x = none;
    for (std::size_t j = 0; j < n; ++j) {
      const V prefactor = j < 4 ? zero : to_.direct_log_rate;
      x = x + (l0.v[j] - prefactor) * x0[j] + (l1.v[j] - prefactor) * x1[j] + bend.v[j] * xb[j];
      rate_x = rate_x + (l1.v[j] - prefactor) * flow[j];
    }
    put(Cause::log_energy, x, rate_x);
  }
  if (is_wanted(Cause::log_span)) put(Cause::log_span, by_span, none);
  if (is_wanted(Cause::stabilization)) {
    const V start_by = start.squeezed * barrier, end_by = end.squeezed * barrier;
    put(Cause::stabilization, start_by * back_0 + end_by * back_1, end_by * rate_back);
  }
  const V scale = energy * barrier, start_back = barrier * start.back_factor,
          end_back = barrier * end.back_factor;
  // By ln of the barriers towards +, less that by ln of those towards -.
  if (is_wanted(Cause::asymmetry)) {
    const auto by = [&](const End<n>& e, V back, const Pair* x) HWY_ATTR {
      const V up = energy * to_.towards_plus, down = hn::Neg(energy * to_.towards_minus);
      Pair sum = down * barrier * e.slope[0].barrier * x[0] + up * back * e.slope[1].barrier * x[1] +
                 down * back * e.slope[2].barrier * x[2] + up * barrier * e.slope[3].barrier * x[3];
      if constexpr (n > 4)
        sum = sum + down * direct * e.slope[4].barrier * x[4] + up * direct * e.slope[5].barrier * x[5];
      return sum;
    };
    put(Cause::asymmetry, by(start, start_back, x0) + by(end, end_back, x1), by(end, end_back, flow));
  }
  // By ln of the barriers between + and -, all of which is ln(dg0) and ln(direct_barrier).
  Pair direct_by = none, direct_rate_by = none;
  if constexpr (n > 4) {
    const auto by = [&](const End<n>& e, const Pair* x) HWY_ATTR {
      return energy * direct * to_.towards_minus * e.slope[4].barrier * x[4] +
             energy * direct * to_.towards_plus * e.slope[5].barrier * x[5];
    };
    direct_by = by(start, x0) + by(end, x1) + direct_bend_barrier;
    direct_rate_by = by(end, flow);
    if (is_wanted(Cause::log_direct_rate))
      put(Cause::log_direct_rate, x0[4] + x0[5] + x1[4] + x1[5], flow[4] + flow[5]);
    if (is_wanted(Cause::direct_barrier))
      put(Cause::direct_barrier, one / to_.direct_barrier * direct_by,
          one / to_.direct_barrier * direct_rate_by);
  }
  if (is_wanted(Cause::log_barrier) || is_wanted(Cause::barrier_log_std) || is_wanted(Cause::skewness) ||
      is_wanted(Cause::inverse_freedom)) {
    const auto by = [&](const End<n>& e, V back, const Pair& back_x, const Pair* x) HWY_ATTR {
      return scale * to_.towards_minus * e.slope[0].barrier * x[0] +
             scale * to_.towards_plus * e.slope[3].barrier * x[3] + back * back_x;
    };
    const Pair x =
        by(start, start_back, back_0, x0) + by(end, end_back, back_1, x1) + bend_barrier + direct_by;
    const Pair rate_x = by(end, end_back, rate_back, flow) + direct_rate_by;
    if (is_wanted(Cause::log_barrier)) put(Cause::log_barrier, x, rate_x);
    if (is_wanted(Cause::barrier_log_std)) {
      const V z = load(step_.quantile[0] + i);
      put(Cause::barrier_log_std, z * x, z * rate_x);
    }
    if (is_wanted(Cause::skewness)) {
      const V moved = load(step_.by_skewness + i);
      put(Cause::skewness, moved * x, moved * rate_x);
    }
    if (is_wanted(Cause::inverse_freedom)) {
      const V moved = load(step_.by_inverse_freedom[0] + i), field = load(step_.by_inverse_freedom[1] + i),
              stress = load(step_.by_inverse_freedom[2] + i);
      put(Cause::inverse_freedom, moved * x + field * (field_0 + field_1) + stress * (stress_0 + stress_1),
          moved * rate_x + field * rate_field + stress * rate_stress);
    }
  }
}

}  // namespace ferrobench::model::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif

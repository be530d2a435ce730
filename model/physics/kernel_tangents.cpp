#include "model/physics/kernel_tangents.h"

#include <algorithm>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "model/physics/kernel_tangents.cpp"
#include <hwy/foreach_target.h>
// The order matters: the line above makes this file be read once for each instruction set.
#include "model/physics/kernel_tangents-inl.h"

HWY_BEFORE_NAMESPACE();
namespace ferrobench::model::HWY_NAMESPACE {

// What each cause does to a row: to its fractions, and to its weighted rates at the end beside what the
// fractions do.
struct Effect {
  Pair x, rate;
};
HWY_INLINE Effect operator+(const Effect& a, const Effect& b) {
  return {a.x + b.x, a.rate + b.rate};
}
HWY_INLINE Effect operator*(V a, const Effect& b) {
  return {a * b.x, a * b.rate};
}

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
  template <class Law>
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

template <class Law>
HWY_INLINE void Step::rows(std::size_t i, std::size_t at, const std::array<bool, cause_count>& wanted,
                           BlockJacobian& out, std::array<Pair, cause_count>& rates) const {
  const D d;
  const V zero = hn::Zero(d), one = set(1.0), minus_one = set(-1.0);
  const End ends[2] = {end_of<Law>(then_, domains_, i), end_of<Law>(to_, domains_, i)};
  const Forces from = forces(from_, domains_, i);
  const V barrier = load(domains_.barrier + i), inverse_barrier = load(domains_.inverse_barrier + i);

  // Bends, as in step_with, and their slopes by the force's step, by its sum and by the force's own bend.
  const V push = set(-4.0) * to_.minus_inverse_energy, eighth = set(1.0 / 8) * inverse_barrier;
  const V by_square = to_.minus_inverse_energy * set(-1.0 / 8) * inverse_barrier;
  const V limit = set(4.0) * barrier;
  const auto bend_of = [&](V f0, V f1, V bend, V& out_bend, V& back_bend, V* slopes) HWY_ATTR {
    const bool bent = step_.path.bend.stress != 0 || step_.path.bend.field != 0;
    twice_bends(to_, f0, f1, bend, bent, barrier, inverse_barrier, out_bend, back_bend);
    const auto inside = hn::Lt(hn::Max(hn::Abs(f0), hn::Abs(f1)), limit);
    const V raw = (f0 + f1) * eighth, middle = clamp(raw, set(-1.0), one);
    slopes[0] = hn::IfThenElseZero(inside, set(2.0) * by_square * (f1 - f0));
    slopes[1] = hn::IfThenElseZero(hn::Lt(hn::Abs(raw), one), hn::Neg(push * bend) * eighth);
    slopes[2] = middle;
    slopes[3] = hn::IfThenElseZero(inside, by_square * (f1 - f0) * (f1 - f0));
  };
  const V bend_even = set(step_.path.bend.stress) * to_.strain_90;
  const V bend_odd = set(step_.path.bend.field) * to_.polarization;
  Four bend;
  V slopes[2][4];
  bend_of(from.plus, ends[1].force_plus, bend_even - bend_odd, bend.v[0], bend.v[1], slopes[0]);
  bend_of(from.minus, ends[1].force_minus, bend_even + bend_odd, bend.v[3], bend.v[2], slopes[1]);

  const V half_span = set(0.5 * step_.h / k_.relaxation_time);
  Four l[2], r[2], intensity;
  Transition mean[4];
  for (int j = 0; j < 4; ++j) {
    l[0].v[j] = load(step_.before.log_rate[j] + i);
    l[1].v[j] = load(step_.after.log_rate[j] + i);
    r[0].v[j] = load(step_.before.rate[j] + i);
    r[1].v[j] = load(step_.after.rate[j] + i);
    mean[j] = transition(l[0].v[j], l[1].v[j], r[0].v[j], r[1].v[j], bend.v[j]);
    intensity.v[j] = half_span * mean[j].twice_mean;
  }
  const Propagation p = propagation(intensity, load(domains_.plus + i), load(domains_.minus + i));
  const V weight = hn::IfThenElseZero(hn::FirstN(d, count_ - i), load(domains_.weight + i));
  const V ninety = one - p.plus - p.minus;

  const V* const rate = r[1].v;
  hn::StoreU(p.a[0][0], d, out.a[0] + at);
  hn::StoreU(p.a[0][1], d, out.a[1] + at);
  hn::StoreU(p.a[1][0], d, out.a[2] + at);
  hn::StoreU(p.a[1][1], d, out.a[3] + at);
  hn::StoreU(hn::Neg(weight * (rate[0] + rate[1])), d, out.rate[0] + at);
  hn::StoreU(hn::Neg(weight * rate[1]), d, out.rate[1] + at);
  hn::StoreU(hn::Neg(weight * rate[2]), d, out.rate[2] + at);
  hn::StoreU(hn::Neg(weight * (rate[2] + rate[3])), d, out.rate[3] + at);

  // By ln(rate) at both ends and by the bends.
  const V flow[4] = {hn::Neg(rate[0] * p.plus), rate[1] * ninety, rate[2] * ninety,
                     hn::Neg(rate[3] * p.minus)};
  Effect by_log[2][4], by_bend[4];
  for (int j = 0; j < 4; ++j) {
    by_log[0][j] = {half_span * mean[j].before * p.by[j], {zero, zero}};
    by_log[1][j] = {half_span * mean[j].after * p.by[j],
                    j < 2 ? Pair{weight * flow[j], zero} : Pair{zero, weight * flow[j]}};
    by_bend[j] = {half_span * mean[j].twice_bend * p.by[j], {zero, zero}};
  }
  // By the driving forces at both ends: through ln(rate), and with the bend, besides by the bend's own force.
  Effect by_log_force[2][2], by_force[2][2], by_bend_force[2];
  for (int s = 0; s < 2; ++s) {
    const int out_j = s == 0 ? 0 : 3, back_j = s == 0 ? 1 : 2;
    const Effect by_both = by_bend[out_j] + by_bend[back_j];
    by_bend_force[s] =
        push * ((one - slopes[s][2]) * by_bend[out_j] + hn::Neg(one + slopes[s][2]) * by_bend[back_j]);
    for (int e = 0; e < 2; ++e) {
      const V sign = e == 0 ? minus_one : one;
      by_log_force[e][s] = to_.minus_inverse_energy * (ends[e].slope[out_j].force * by_log[e][out_j] +
                                                       ends[e].slope[back_j].force * by_log[e][back_j]);
      by_force[e][s] = by_log_force[e][s] + (sign * slopes[s][0] + slopes[s][1]) * by_both;
    }
  }
  const auto by_even_odd = [&](int e, V even, V odd) HWY_ATTR {
    return (even - odd) * by_force[e][0] + (even + odd) * by_force[e][1];
  };
  const auto by_slope = [&](int e, V BarrierSlope::*member) HWY_ATTR {
    Effect sum = ends[e].slope[0].*member * by_log[e][0];
    for (int j = 1; j < 4; ++j) sum = sum + ends[e].slope[j].*member * by_log[e][j];
    return to_.minus_inverse_energy * sum;
  };
  const auto by_back_barrier = [&](int e) HWY_ATTR {
    return to_.minus_inverse_energy *
           (ends[e].slope[1].barrier * by_log[e][1] + ends[e].slope[2].barrier * by_log[e][2]);
  };
  const auto by_field = [&](int e)
                            HWY_ATTR { return by_even_odd(e, ends[e].even_by_field, ends[e].odd_by_field); };
  const auto by_stress = [&](int e) HWY_ATTR {
    const Effect by = by_even_odd(e, ends[e].even_by_stress, ends[e].odd_by_stress);
    return k_.stress_stabilization == 0 ? by : by + ends[e].back_by_stress * by_back_barrier(e);
  };
  const auto put = [&](Cause cause, const auto& effect) HWY_ATTR {
    const auto c = static_cast<std::size_t>(cause);
    if (!wanted[c]) return;
    const Effect e = effect();
    hn::StoreU(e.x.plus, d, out.cause[c][0] + at);
    hn::StoreU(e.x.minus, d, out.cause[c][1] + at);
    rates[c] = rates[c] + e.rate;
  };
  put(Cause::field_before, [&]() HWY_ATTR { return by_field(0); });
  put(Cause::field_after, [&]() HWY_ATTR { return by_field(1); });
  put(Cause::stress_before, [&]() HWY_ATTR { return by_stress(0); });
  put(Cause::stress_after, [&]() HWY_ATTR { return by_stress(1); });
  put(Cause::bend, [&]() HWY_ATTR { return to_.strain_90 * (by_bend_force[0] + by_bend_force[1]); });
  // The bend knows only P_+ of this step.
  const Effect start_by_old = ends[0].field * (by_log_force[0][1] + minus_one * by_log_force[0][0]);
  put(Cause::polarization_before,
      [&]() HWY_ATTR { return start_by_old + by_slope(0, &BarrierSlope::polarization); });
  put(Cause::polarization_after, [&]() HWY_ATTR {
    return by_even_odd(0, zero, ends[0].field) + minus_one * start_by_old +
           by_even_odd(1, zero, ends[1].field) + by_slope(1, &BarrierSlope::polarization);
  });
  put(Cause::strain_90, [&]() HWY_ATTR {
    return by_even_odd(0, ends[0].stress, zero) + by_even_odd(1, ends[1].stress, zero) +
           set(step_.path.bend.stress) * (by_bend_force[0] + by_bend_force[1]);
  });
  put(Cause::piezoelectric, [&]() HWY_ATTR {
    return by_even_odd(0, zero, ends[0].field * ends[0].stress) +
           by_even_odd(1, zero, ends[1].field * ends[1].stress);
  });
  put(Cause::half_permittivity, [&]() HWY_ATTR {
    return by_even_odd(0, hn::Neg(ends[0].field * ends[0].field), zero) +
           by_even_odd(1, hn::Neg(ends[1].field * ends[1].field), zero) +
           by_slope(0, &BarrierSlope::permittivity) + by_slope(1, &BarrierSlope::permittivity);
  });
  put(Cause::half_compliance, [&]() HWY_ATTR {
    return by_even_odd(0, hn::Neg(ends[0].stress * ends[0].stress), zero) +
           by_even_odd(1, hn::Neg(ends[1].stress * ends[1].stress), zero);
  });
  put(Cause::log_energy, [&]() HWY_ATTR {
    Effect sum = l[0].v[0] * by_log[0][0] + l[1].v[0] * by_log[1][0] + bend.v[0] * by_bend[0];
    for (int j = 1; j < 4; ++j)
      sum = sum + l[0].v[j] * by_log[0][j] + l[1].v[j] * by_log[1][j] + bend.v[j] * by_bend[j];
    return sum;
  });
  put(Cause::log_span, [&]() HWY_ATTR {
    Effect sum{intensity.v[0] * p.by[0], {zero, zero}};
    for (int j = 1; j < 4; ++j) sum.x = sum.x + intensity.v[j] * p.by[j];
    return sum;
  });
  put(Cause::stabilization, [&]() HWY_ATTR {
    return ends[0].squeezed * barrier * by_back_barrier(0) + ends[1].squeezed * barrier * by_back_barrier(1);
  });
  const auto by_log_barrier = [&]() HWY_ATTR {
    Effect sum{{zero, zero}, {zero, zero}};
    for (int e = 0; e < 2; ++e) {
      sum = sum +
            barrier * to_.minus_inverse_energy *
                (ends[e].slope[0].barrier * by_log[e][0] + ends[e].slope[3].barrier * by_log[e][3]) +
            barrier * ends[e].back_factor * by_back_barrier(e);
    }
    for (int s = 0; s < 2; ++s) {
      const Effect by_both = by_bend[s == 0 ? 0 : 3] + by_bend[s == 0 ? 1 : 2];
      const V sum_of_forces = s == 0 ? from.plus + ends[1].force_plus : from.minus + ends[1].force_minus;
      sum = sum + hn::Neg(slopes[s][3] + slopes[s][1] * sum_of_forces) * by_both;
    }
    return sum;
  };
  put(Cause::log_barrier, by_log_barrier);
  put(Cause::barrier_log_std, [&]() HWY_ATTR { return load(step_.z[0] + i) * by_log_barrier(); });
  put(Cause::internal_field, [&]() HWY_ATTR { return by_field(0) + by_field(1); });
  put(Cause::internal_field_std,
      [&]() HWY_ATTR { return load(step_.z[1] + i) * (by_field(0) + by_field(1)); });
  put(Cause::internal_stress_std,
      [&]() HWY_ATTR { return load(step_.z[2] + i) * (by_stress(0) + by_stress(1)); });
}

// Moves one direction's tangents over a block of rows.
HWY_INLINE void move(const BlockJacobian& jacobian, const DomainColumns& domains, std::size_t first,
                     std::size_t end, std::size_t count, const FractionTangents& direction, Pair& x,
                     Pair& rate) {
  const D d;
  const double* causes[cause_count][2];
  double by[cause_count];
  std::size_t active = 0;
  for (std::size_t c = 0; c < cause_count; ++c)
    if ((*direction.causes)[c] != 0) {
      causes[active][0] = jacobian.cause[c][0];
      causes[active][1] = jacobian.cause[c][1];
      by[active++] = (*direction.causes)[c];
    }
  for (std::size_t i = first; i < end; i += hn::Lanes(d)) {
    const std::size_t at = i - first;
    const V plus = load(direction.plus + i), minus = load(direction.minus + i);
    V p = hn::MulAdd(load(jacobian.a[0] + at), plus, load(jacobian.a[1] + at) * minus);
    V m = hn::MulAdd(load(jacobian.a[2] + at), plus, load(jacobian.a[3] + at) * minus);
    for (std::size_t c = 0; c < active; ++c) {
      const V amount = set(by[c]);
      p = hn::MulAdd(amount, load(causes[c][0] + at), p);
      m = hn::MulAdd(amount, load(causes[c][1] + at), m);
    }
    // Rows past `count` in the last vector belong to others.
    const auto ours = hn::FirstN(d, count - i);
    hn::StoreU(hn::IfThenElse(ours, p, plus), d, direction.plus + i);
    hn::StoreU(hn::IfThenElse(ours, m, minus), d, direction.minus + i);
    const V weight = hn::IfThenElseZero(ours, load(domains.weight + i));
    x.plus = hn::MulAdd(weight, p, x.plus);
    x.minus = hn::MulAdd(weight, m, x.minus);
    rate.plus =
        hn::MulAdd(load(jacobian.rate[0] + at), p, hn::MulAdd(load(jacobian.rate[1] + at), m, rate.plus));
    rate.minus =
        hn::MulAdd(load(jacobian.rate[2] + at), p, hn::MulAdd(load(jacobian.rate[3] + at), m, rate.minus));
  }
}

double total(V v) {
  const D d;
  return hn::GetLane(hn::SumOfLanes(d, v));
}

template <class Law>
void tangents_with(const KineticConstants& k, const DomainColumns& domains, std::size_t count,
                   const TangentStep& step, const std::vector<FractionTangents>& directions,
                   std::vector<MeanTangents>& out) {
  const D d;
  const V zero = hn::Zero(d);
  std::array<bool, cause_count> wanted{};
  for (const auto& direction : directions)
    for (std::size_t c = 0; c < cause_count; ++c) wanted[c] = wanted[c] || (*direction.causes)[c] != 0;
  const Step rows(k, domains, count, step);
  std::array<Pair, cause_count> by_cause;
  by_cause.fill({zero, zero});
  out.assign(directions.size(), {});
  BlockJacobian jacobian;
  for (std::size_t first = 0; first < count; first += block) {
    const std::size_t end = std::min(first + block, count);
    for (std::size_t i = first; i < end; i += hn::Lanes(d))
      rows.rows<Law>(i, i - first, wanted, jacobian, by_cause);
    for (std::size_t n = 0; n < directions.size(); ++n) {
      Pair x{zero, zero}, rate{zero, zero};
      move(jacobian, domains, first, end, count, directions[n], x, rate);
      out[n].plus += total(x.plus);
      out[n].minus += total(x.minus);
      out[n].plus_rate += total(rate.plus);
      out[n].minus_rate += total(rate.minus);
    }
  }
  for (std::size_t c = 0; c < cause_count; ++c) {
    if (!wanted[c]) continue;
    const double plus = total(by_cause[c].plus), minus = total(by_cause[c].minus);
    for (std::size_t n = 0; n < directions.size(); ++n) {
      out[n].plus_rate += (*directions[n].causes)[c] * plus;
      out[n].minus_rate += (*directions[n].causes)[c] * minus;
    }
  }
}

void tangents(const KineticConstants& k, const DomainColumns& domains, std::size_t count,
              const TangentStep& step, const std::vector<FractionTangents>& directions,
              std::vector<MeanTangents>& out) {
  k.law == BarrierLaw::equal_curvature
      ? tangents_with<EqualCurvature>(k, domains, count, step, directions, out)
      : tangents_with<UnequalCurvature>(k, domains, count, step, directions, out);
}

}  // namespace ferrobench::model::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ferrobench::model {

HWY_EXPORT(tangents);

void step_tangents(const KineticConstants& k, const DomainColumns& domains, std::size_t count,
                   const TangentStep& step, const std::vector<FractionTangents>& directions,
                   std::vector<MeanTangents>& out) {
  HWY_DYNAMIC_DISPATCH(tangents)(k, domains, count, step, directions, out);
}

}  // namespace ferrobench::model
#endif

#include "model/physics/kernel_tangents.h"

#include <algorithm>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "model/physics/kernel_tangents.cpp"
#include <hwy/foreach_target.h>
// The order matters: the line above makes this file be read once for each instruction set.
#include "model/physics/kernel_tangents-inl.h"

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
  const V zero = hn::Zero(d), one = set(1.0);
  End ends[2];
  end_of<Law>(then_, domains_, i, ends[0]);
  end_of<Law>(to_, domains_, i, ends[1]);
  const End &start = ends[0], &end = ends[1];
  const Forces from = forces(from_, domains_, i);
  const V barrier = load(domains_.barrier + i), inverse_barrier = load(domains_.inverse_barrier + i);

  // Bends as in step_with, of F_{+,90} and of F_{-,90}.
  const V bend_even = set(step_.path.bend.stress) * to_.strain_90;
  const V bend_odd = set(step_.path.bend.field) * to_.polarization;
  const bool bent = step_.path.bend.stress != 0 || step_.path.bend.field != 0;
  Four bend;
  twice_bends(to_, from.plus, end.force_plus, bend_even - bend_odd, bent, barrier, inverse_barrier, bend.v[0],
              bend.v[1]);
  twice_bends(to_, from.minus, end.force_minus, bend_even + bend_odd, bent, barrier, inverse_barrier,
              bend.v[3], bend.v[2]);

  const V half_span = set(0.5 * step_.h / k_.relaxation_time);
  Four l0, l1, rate, intensity;
  Transition mean[4];
  for (int j = 0; j < 4; ++j) {
    l0.v[j] = load(step_.before.log_rate[j] + i);
    l1.v[j] = load(step_.after.log_rate[j] + i);
    rate.v[j] = load(step_.after.rate[j] + i);
    mean[j] = transition(l0.v[j], l1.v[j], load(step_.before.rate[j] + i), rate.v[j], bend.v[j]);
    intensity.v[j] = half_span * mean[j].twice_mean;
  }
  const Propagation p = propagation(intensity, load(domains_.plus + i), load(domains_.minus + i));
  const V weight = hn::IfThenElseZero(hn::FirstN(d, count_ - i), load(domains_.weight + i));
  hn::StoreU(p.a[0][0], d, out.a[0] + at);
  hn::StoreU(p.a[0][1], d, out.a[1] + at);
  hn::StoreU(p.a[1][0], d, out.a[2] + at);
  hn::StoreU(p.a[1][1], d, out.a[3] + at);
  hn::StoreU(hn::Neg(weight * (rate.v[0] + rate.v[1])), d, out.rate[0] + at);
  hn::StoreU(hn::Neg(weight * rate.v[1]), d, out.rate[1] + at);
  hn::StoreU(hn::Neg(weight * rate.v[2]), d, out.rate[2] + at);
  hn::StoreU(hn::Neg(weight * (rate.v[2] + rate.v[3])), d, out.rate[3] + at);

  // x' by ln(rate) at both ends and by the bends; the weighted rates at the end by ln(rate) there, the first
  // two of the plus rate, the others of the minus rate.
  Pair x0[4], x1[4], xb[4];
  for (int j = 0; j < 4; ++j) {
    const Pair by = half_span * p.by[j];
    x0[j] = mean[j].before * by;
    x1[j] = mean[j].after * by;
    xb[j] = mean[j].twice_bend * by;
  }
  const V ninety = weight * (one - p.plus - p.minus);
  const V flow[4] = {hn::Neg(rate.v[0] * (weight * p.plus)), rate.v[1] * ninety, rate.v[2] * ninety,
                     hn::Neg(rate.v[3] * (weight * p.minus))};

  // By the driving forces: at the start through ln(rate) and through the bend, at the end through both, at
  // mid-step.
  const V energy = to_.minus_inverse_energy, push = set(-4.0) * energy;
  const V by_square = energy * set(-1.0 / 8) * inverse_barrier, eighth = set(1.0 / 8) * inverse_barrier;
  const V limit = set(4.0) * barrier;
  const Pair both[2] = {xb[0] + xb[1], xb[3] + xb[2]};
  Pair old_force[2], start_force[2], end_force[2], bend_force[2];
  V rate_force[2], by_barrier[2];  // the bend by ln(dg0)
  const auto side = [&](int s, int out_j, int back_j, V f0, V f1, V force_bend) HWY_ATTR {
    const V moved = f1 - f0;
    const auto inside = hn::Lt(hn::Max(hn::Abs(f0), hn::Abs(f1)), limit);
    const V by_moved = hn::IfThenElseZero(inside, set(2.0) * by_square * moved);
    V by_sum = zero, middle = zero;
    if (bent) {
      const V raw = (f0 + f1) * eighth;
      middle = clamp(raw, set(-1.0), one);
      by_sum = hn::IfThenElseZero(hn::Lt(hn::Abs(raw), one), hn::Neg(push * force_bend) * eighth);
    }
    by_barrier[s] = hn::Neg(set(0.5) * by_moved * moved + by_sum * (f0 + f1));
    old_force[s] =
        energy * start.slope[out_j].force * x0[out_j] + energy * start.slope[back_j].force * x0[back_j];
    start_force[s] = (by_sum - by_moved) * both[s];
    end_force[s] = energy * end.slope[out_j].force * x1[out_j] +
                   energy * end.slope[back_j].force * x1[back_j] + (by_sum + by_moved) * both[s];
    bend_force[s] = push * (one - middle) * xb[out_j] + hn::Neg(push * (one + middle)) * xb[back_j];
    rate_force[s] = energy * (end.slope[out_j].force * flow[out_j] + end.slope[back_j].force * flow[back_j]);
  };
  side(0, 0, 1, from.plus, end.force_plus, bend_even - bend_odd);
  side(1, 3, 2, from.minus, end.force_minus, bend_even + bend_odd);

  const auto is_wanted = [&](Cause cause) HWY_ATTR { return wanted[static_cast<std::size_t>(cause)]; };
  const auto put = [&](Cause cause, const Pair& x, const Pair& rate_by) HWY_ATTR {
    const auto c = static_cast<std::size_t>(cause);
    hn::StoreU(x.plus, d, out.cause[c][0] + at);
    hn::StoreU(x.minus, d, out.cause[c][1] + at);
    rates[c] = rates[c] + rate_by;
  };
  const Pair none{zero, zero};
  // By the even and odd part of the forces.
  const auto x_by = [&](const Pair* force, V even, V odd)
                        HWY_ATTR { return (even - odd) * force[0] + (even + odd) * force[1]; };
  const auto rate_by = [&](V even, V odd) HWY_ATTR {
    return Pair{(even - odd) * rate_force[0], (even + odd) * rate_force[1]};
  };
  const Pair all_start[2] = {old_force[0] + start_force[0], old_force[1] + start_force[1]};

  // By the loads.
  const Pair field_0 = x_by(all_start, start.even_by_field, start.odd_by_field);
  const Pair field_1 = x_by(end_force, end.even_by_field, end.odd_by_field);
  const Pair rate_field = rate_by(end.even_by_field, end.odd_by_field);
  Pair stress_0 = x_by(all_start, start.even_by_stress, start.odd_by_stress);
  Pair stress_1 = x_by(end_force, end.even_by_stress, end.odd_by_stress);
  Pair rate_stress = rate_by(end.even_by_stress, end.odd_by_stress);
  // By the barriers of 90 -> +/-180.
  const Pair back_0 = energy * start.slope[1].barrier * x0[1] + energy * start.slope[2].barrier * x0[2];
  const Pair back_1 = energy * end.slope[1].barrier * x1[1] + energy * end.slope[2].barrier * x1[2];
  const Pair rate_back{energy * end.slope[1].barrier * flow[1], energy * end.slope[2].barrier * flow[2]};
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
    const V z = load(step_.z[1] + i);
    put(Cause::internal_field_std, z * (field_0 + field_1), z * rate_field);
  }
  if (is_wanted(Cause::internal_stress_std)) {
    const V z = load(step_.z[2] + i);
    put(Cause::internal_stress_std, z * (stress_0 + stress_1), z * rate_stress);
  }

  // By the constants. A law's own slopes, besides those through the forces:
  const auto law_by = [&](V BarrierSlope::*member, const End& e, const Pair* x) HWY_ATTR {
    return energy * (e.slope[0].*member * x[0] + e.slope[1].*member * x[1] + e.slope[2].*member * x[2] +
                     e.slope[3].*member * x[3]);
  };
  const auto law_rate_by = [&](V BarrierSlope::*member) HWY_ATTR {
    return energy * Pair{end.slope[0].*member * flow[0] + end.slope[1].*member * flow[1],
                         end.slope[2].*member * flow[2] + end.slope[3].*member * flow[3]};
  };
  if (is_wanted(Cause::polarization_before))
    put(Cause::polarization_before,
        x_by(old_force, zero, start.field) + law_by(&BarrierSlope::polarization, start, x0), none);
  if (is_wanted(Cause::polarization_after))  // the bend knows no other P_+
    put(Cause::polarization_after,
        x_by(start_force, zero, start.field) + x_by(end_force, zero, end.field) +
            law_by(&BarrierSlope::polarization, end, x1),
        rate_by(zero, end.field) + law_rate_by(&BarrierSlope::polarization));
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
        rate_by(even_1, zero) + law_rate_by(&BarrierSlope::permittivity));
  }
  if (is_wanted(Cause::half_compliance)) {
    const V even_0 = hn::Neg(start.stress * start.stress), even_1 = hn::Neg(end.stress * end.stress);
    put(Cause::half_compliance, x_by(all_start, even_0, zero) + x_by(end_force, even_1, zero),
        rate_by(even_1, zero));
  }
  if (is_wanted(Cause::log_energy)) {
    Pair x = none;
    for (int j = 0; j < 4; ++j) x = x + l0.v[j] * x0[j] + l1.v[j] * x1[j] + bend.v[j] * xb[j];
    put(Cause::log_energy, x, {l1.v[0] * flow[0] + l1.v[1] * flow[1], l1.v[2] * flow[2] + l1.v[3] * flow[3]});
  }
  if (is_wanted(Cause::log_span)) {
    Pair x = none;
    for (int j = 0; j < 4; ++j) x = x + intensity.v[j] * p.by[j];
    put(Cause::log_span, x, none);
  }
  if (is_wanted(Cause::stabilization)) {
    const V start_by = start.squeezed * barrier, end_by = end.squeezed * barrier;
    put(Cause::stabilization, start_by * back_0 + end_by * back_1, end_by * rate_back);
  }
  if (is_wanted(Cause::log_barrier) || is_wanted(Cause::barrier_log_std)) {
    const V scale = energy * barrier, start_back = barrier * start.back_factor,
            end_back = barrier * end.back_factor;
    const Pair x = scale * (start.slope[0].barrier * x0[0] + start.slope[3].barrier * x0[3] +
                            end.slope[0].barrier * x1[0] + end.slope[3].barrier * x1[3]) +
                   start_back * back_0 + end_back * back_1 + by_barrier[0] * both[0] +
                   by_barrier[1] * both[1];
    const Pair rate_x =
        scale * Pair{end.slope[0].barrier * flow[0], end.slope[3].barrier * flow[3]} + end_back * rate_back;
    if (is_wanted(Cause::log_barrier)) put(Cause::log_barrier, x, rate_x);
    if (is_wanted(Cause::barrier_log_std)) {
      const V z = load(step_.z[0] + i);
      put(Cause::barrier_log_std, z * x, z * rate_x);
    }
  }
}

// Moves one direction's tangents over a block of rows; `sums` has those of x', then of the rates, of each
// lane.
HWY_INLINE void move(const BlockJacobian& jacobian, const DomainColumns& domains, std::size_t first,
                     std::size_t end, std::size_t count, const FractionTangents& direction, double* sums) {
  const D d;
  const std::size_t lanes = hn::Lanes(d);
  const double* causes[cause_count][2];
  double by[cause_count];
  std::size_t active = 0;
  for (std::size_t c = 0; c < cause_count; ++c)
    if ((*direction.causes)[c] != 0) {
      causes[active][0] = jacobian.cause[c][0];
      causes[active][1] = jacobian.cause[c][1];
      by[active++] = (*direction.causes)[c];
    }
  Pair x{load(sums), load(sums + lanes)}, rate{load(sums + 2 * lanes), load(sums + 3 * lanes)};
  for (std::size_t i = first; i < end; i += lanes) {
    const std::size_t at = i - first;
    const V plus = load(direction.plus + i), minus = load(direction.minus + i);
    V p = hn::Zero(d), m = p;
    if (!direction.fresh) {
      p = hn::MulAdd(load(jacobian.a[0] + at), plus, load(jacobian.a[1] + at) * minus);
      m = hn::MulAdd(load(jacobian.a[2] + at), plus, load(jacobian.a[3] + at) * minus);
    }
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
  hn::StoreU(x.plus, d, sums);
  hn::StoreU(x.minus, d, sums + lanes);
  hn::StoreU(rate.plus, d, sums + 2 * lanes);
  hn::StoreU(rate.minus, d, sums + 3 * lanes);
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
  const std::size_t lanes = hn::Lanes(d);
  std::vector<double> sums(4 * lanes * directions.size(), 0.0);  // of each lane
  BlockJacobian jacobian;
  for (std::size_t first = 0; first < count; first += block) {
    const std::size_t end = std::min(first + block, count);
    for (std::size_t i = first; i < end; i += lanes) rows.rows<Law>(i, i - first, wanted, jacobian, by_cause);
    for (std::size_t n = 0; n < directions.size(); ++n)
      move(jacobian, domains, first, end, count, directions[n], sums.data() + 4 * lanes * n);
  }
  for (std::size_t n = 0; n < directions.size(); ++n) {
    const double* at = sums.data() + 4 * lanes * n;
    out[n] = {total(load(at)), total(load(at + lanes)), total(load(at + 2 * lanes)),
              total(load(at + 3 * lanes))};
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

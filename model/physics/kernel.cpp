#include "model/physics/kernel.h"

#include <algorithm>
#include <array>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "model/physics/kernel.cpp"
#include <hwy/foreach_target.h>
// The order matters: the line above makes this file be read once for each instruction set.
#include "model/physics/kernel-inl.h"

HWY_BEFORE_NAMESPACE();
namespace ferrobench::model::HWY_NAMESPACE {
struct Sums {
  V plus, minus, plus_rate, minus_rate;
};

// Rows past `count` in the last vector belong to others: they add nothing to the sums.
template <std::size_t n>
HWY_INLINE void finish(const DomainColumns& domains, std::size_t i, std::size_t count,
                       const PerTransition<n>& rate, V plus, V minus, const StepOutput& out, V negligible,
                       Sums& sums) {
  const D d;
  const V one = hn::Set(d, 1.0), zero = hn::Zero(d);
  hn::StoreU(plus, d, out.plus + i);
  hn::StoreU(minus, d, out.minus + i);
  const V weight = hn::IfThenElseZero(hn::FirstN(d, count - i), hn::LoadU(d, domains.weight + i));
  const V ninety = hn::Sub(hn::Sub(one, plus), minus);
  sums.plus = hn::MulAdd(weight, plus, sums.plus);
  sums.minus = hn::MulAdd(weight, minus, sums.minus);
  V plus_rate = hn::MulSub(rate.v[1], ninety, hn::Mul(rate.v[0], plus));
  V minus_rate = hn::MulSub(rate.v[2], ninety, hn::Mul(rate.v[3], minus));
  const auto counted = [&](V x) HWY_ATTR { return hn::IfThenElse(hn::Gt(x, negligible), x, zero); };
  const V counted_ninety = counted(ninety), counted_plus = counted(plus), counted_minus = counted(minus);
  V falling = hn::MulAdd(counted_ninety, rate.v[2], hn::Mul(counted_plus, rate.v[0]));
  V rising = hn::MulAdd(counted_ninety, rate.v[1], hn::Mul(counted_minus, rate.v[3]));
  if constexpr (n > 4) {
    const V exchange = hn::MulSub(rate.v[5], minus, hn::Mul(rate.v[4], plus));
    plus_rate = hn::Add(plus_rate, exchange);
    minus_rate = hn::Sub(minus_rate, exchange);
    falling = hn::MulAdd(counted_plus, rate.v[4], falling);
    rising = hn::MulAdd(counted_minus, rate.v[5], rising);
  }
  sums.plus_rate = hn::MulAdd(weight, plus_rate, sums.plus_rate);
  sums.minus_rate = hn::MulAdd(weight, minus_rate, sums.minus_rate);
  hn::StoreU(falling, d, out.outflow_falling + i);
  hn::StoreU(rising, d, out.outflow_rising + i);
}

StepResult reduce(const Sums& sums, double tau) {
  const D d;
  const auto sum = [&](V v) HWY_ATTR { return hn::GetLane(hn::SumOfLanes(d, v)); };
  return {sum(sums.plus), sum(sums.minus), sum(sums.plus_rate) / tau, sum(sums.minus_rate) / tau};
}

template <class Law, std::size_t n>
void evaluate_with(const KineticConstants& k, const DomainColumns& domains, std::size_t count,
                   const Loads& at, const RateColumns& out) {
  const D d;
  const Broadcast constants(k, at);
  for (std::size_t i = 0; i < count; i += hn::Lanes(d)) {
    const auto l = log_rates<Law, n>(constants, domains, i, forces(constants, domains, i));
    for (std::size_t j = 0; j < n; ++j) {
      hn::StoreU(l.v[j], d, out.log_rate[j] + i);
      hn::StoreU(hn::Exp(d, l.v[j]), d, out.rate[j] + i);
    }
  }
}

// The fractions of rows first to `end` after a step with `span` times the rates `mean`.
template <std::size_t n>
HWY_INLINE void advance(const DomainColumns& domains, std::size_t first, std::size_t end, std::size_t count,
                        const std::array<const double*, n>& mean, V span,
                        const std::array<double*, most_transitions>& rates, const StepOutput& out,
                        Sums& sums) {
  const D d;
  const V negligible = hn::Set(d, out.negligible);
  for (std::size_t i = first; i < end; i += hn::Lanes(d)) {
    PerTransition<n> rate, intensity;
    for (std::size_t j = 0; j < n; ++j) {
      rate.v[j] = hn::LoadU(d, rates[j] + i);
      intensity.v[j] = hn::Mul(span, hn::LoadU(d, mean[j] + (i - first)));
    }
    V plus = hn::LoadU(d, domains.plus + i), minus = hn::LoadU(d, domains.minus + i);
    propagate(intensity, plus, minus);
    finish(domains, i, count, rate, plus, minus, out, negligible, sums);
  }
}

// Where both ways of a pair are fast, the end's rates take their share of twice the mean rates.
template <std::size_t n>
HWY_INLINE void let_the_end_count(V half_span, const PerTransition<n>& end, PerTransition<n>& twice_mean) {
  const D d;
  PerTransition<n / 2> w;
  V most = hn::Zero(d);
  const V square = hn::Mul(half_span, half_span);
  for (std::size_t j = 0; j < n; j += 2) {
    w.v[j / 2] = hn::Mul(square, both_ways(twice_mean.v[j], twice_mean.v[j + 1]));
    most = hn::Max(most, w.v[j / 2]);
  }
  if (hn::AllTrue(d, hn::Lt(most, hn::Set(d, least_both_ways)))) return;
  for (std::size_t j = 0; j < n; ++j) {
    const V share = hn::Div(w.v[j / 2], hn::Add(hn::Set(d, 1.0), w.v[j / 2]));
    twice_mean.v[j] =
        hn::MulAdd(share, hn::MulSub(hn::Set(d, 2.0), end.v[j], twice_mean.v[j]), twice_mean.v[j]);
  }
}

// Short passes over few rows at a time: what one leaves to the next stays near, and the processor works on
// several rows at once.
constexpr std::size_t block = 64;

template <class Law, std::size_t n>
StepResult step_with(const KineticConstants& k, const DomainColumns& domains, std::size_t count, double h,
                     const LoadPath& path, const RateColumns& before, const RateColumns& after,
                     const StepOutput& out) {
  const D d;
  const Broadcast start(k, path.from), constants(k, path.to);
  const V bend_even = hn::Set(d, path.bend.stress * k.strain_90);
  const V bend_odd = hn::Set(d, path.bend.field * k.polarization);
  const bool bent = path.bend.stress != 0 || path.bend.field != 0;
  const V half_span = hn::Set(d, 0.5 * h / k.relaxation_time), zero = hn::Zero(d);
  Sums sums{zero, zero, zero, zero};
  std::array<std::array<double, block>, n> twice_mean;
  std::array<const double*, n> means;
  for (std::size_t j = 0; j < n; ++j) means[j] = twice_mean[j].data();
  for (std::size_t first = 0; first < count; first += block) {
    const std::size_t end = std::min(first + block, count);
    for (std::size_t i = first; i < end; i += hn::Lanes(d)) {
      const Forces f0 = forces(start, domains, i), f1 = forces(constants, domains, i);
      const auto l = log_rates<Law, n>(constants, domains, i, f1);
      const V barrier = hn::LoadU(d, domains.barrier + i);
      const V inverse_barrier = hn::LoadU(d, domains.inverse_barrier + i);
      PerTransition<n> bend, end_rate, mean;
      twice_bends(constants, f0.plus, f1.plus, hn::Sub(bend_even, bend_odd), bent, barrier, inverse_barrier,
                  bend.v[0], bend.v[1]);
      twice_bends(constants, f0.minus, f1.minus, hn::Add(bend_even, bend_odd), bent, barrier, inverse_barrier,
                  bend.v[3], bend.v[2]);
      if constexpr (n > 4)
        twice_bends(constants, hn::Sub(f0.plus, f0.minus), hn::Sub(f1.plus, f1.minus),
                    hn::Mul(hn::Set(d, -2.0), bend_odd), bent, hn::Mul(barrier, constants.direct_barrier),
                    hn::Div(inverse_barrier, constants.direct_barrier), bend.v[4], bend.v[5]);
      for (std::size_t j = 0; j < n; ++j) {
        end_rate.v[j] = hn::Exp(d, l.v[j]);
        mean.v[j] = twice_mean_rate(hn::LoadU(d, before.log_rate[j] + i), l.v[j],
                                    hn::LoadU(d, before.rate[j] + i), end_rate.v[j], bend.v[j]);
        hn::StoreU(l.v[j], d, after.log_rate[j] + i);
        hn::StoreU(end_rate.v[j], d, after.rate[j] + i);
      }
      let_the_end_count(half_span, end_rate, mean);
      for (std::size_t j = 0; j < n; ++j) hn::StoreU(mean.v[j], d, twice_mean[j].data() + (i - first));
    }
    advance<n>(domains, first, end, count, means, half_span, after.rate, out, sums);
  }
  return reduce(sums, k.relaxation_time);
}

void evaluate(const KineticConstants& k, const DomainColumns& domains, std::size_t count, const Loads& at,
              const RateColumns& out) {
  with_law(k, [&](auto law, auto n) { evaluate_with<decltype(law), n>(k, domains, count, at, out); });
}

StepResult step(const KineticConstants& k, const DomainColumns& domains, std::size_t count, double h,
                const LoadPath& path, const RateColumns& before, const RateColumns& after,
                const StepOutput& out) {
  return with_law(k, [&](auto law, auto n) {
    return step_with<decltype(law), n>(k, domains, count, h, path, before, after, out);
  });
}

template <std::size_t n>
StepResult step_held_with(const KineticConstants& k, const DomainColumns& domains, std::size_t count,
                          double h, const RateColumns& before, const StepOutput& out) {
  const D d;
  const V zero = hn::Zero(d);
  Sums sums{zero, zero, zero, zero};
  std::array<const double*, n> rates;
  std::copy_n(before.rate.begin(), n, rates.begin());
  advance<n>(domains, 0, count, count, rates, hn::Set(d, h / k.relaxation_time), before.rate, out, sums);
  return reduce(sums, k.relaxation_time);
}

StepResult step_held(const KineticConstants& k, const DomainColumns& domains, std::size_t count, double h,
                     const RateColumns& before, const StepOutput& out) {
  return with_law(k, [&](auto, auto n) { return step_held_with<n>(k, domains, count, h, before, out); });
}

}  // namespace ferrobench::model::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ferrobench::model {

HWY_EXPORT(evaluate);
HWY_EXPORT(step);
HWY_EXPORT(step_held);

void evaluate_rates(const KineticConstants& k, const DomainColumns& domains, std::size_t count,
                    const Loads& at, const RateColumns& out) {
  HWY_DYNAMIC_DISPATCH(evaluate)(k, domains, count, at, out);
}

StepResult step_domains(const KineticConstants& k, const DomainColumns& domains, std::size_t count, double h,
                        const LoadPath& path, const RateColumns& before, const RateColumns& after,
                        const StepOutput& out) {
  return HWY_DYNAMIC_DISPATCH(step)(k, domains, count, h, path, before, after, out);
}

StepResult step_domains_held(const KineticConstants& k, const DomainColumns& domains, std::size_t count,
                             double h, const RateColumns& before, const StepOutput& out) {
  return HWY_DYNAMIC_DISPATCH(step_held)(k, domains, count, h, before, out);
}

std::vector<std::string> kernel_targets() {
  std::vector<std::string> names;
  for (const auto target : hwy::SupportedAndGeneratedTargets()) names.emplace_back(hwy::TargetName(target));
  return names;
}

void force_kernel_target(const std::string& name) {
  hwy::SetSupportedTargetsForTest(0);  // else only the one forced before would be known
  std::int64_t wanted = 0;
  for (const auto target : hwy::SupportedAndGeneratedTargets())
    if (name == hwy::TargetName(target)) wanted = target;
  hwy::SetSupportedTargetsForTest(wanted);
  hwy::GetChosenTarget().Update(hwy::SupportedTargets());
}

}  // namespace ferrobench::model
#endif

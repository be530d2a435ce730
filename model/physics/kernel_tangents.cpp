#include "model/physics/kernel_tangents.h"

#include <algorithm>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "model/physics/kernel_tangents.cpp"
#include <hwy/foreach_target.h>
// The order matters: the line above makes this file be read once for each instruction set.
#include "model/physics/step_jacobian-inl.h"

HWY_BEFORE_NAMESPACE();
namespace ferrobench::model::HWY_NAMESPACE {

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

template <class Law, std::size_t n>
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
    for (std::size_t i = first; i < end; i += lanes)
      rows.rows<Law, n>(i, i - first, wanted, jacobian, by_cause);
    for (std::size_t m = 0; m < directions.size(); ++m)
      move(jacobian, domains, first, end, count, directions[m], sums.data() + 4 * lanes * m);
  }
  for (std::size_t m = 0; m < directions.size(); ++m) {
    const double* at = sums.data() + 4 * lanes * m;
    out[m] = {total(load(at)), total(load(at + lanes)), total(load(at + 2 * lanes)),
              total(load(at + 3 * lanes))};
  }
  for (std::size_t c = 0; c < cause_count; ++c) {
    if (!wanted[c]) continue;
    const double plus = total(by_cause[c].plus), minus = total(by_cause[c].minus);
    for (std::size_t m = 0; m < directions.size(); ++m) {
      out[m].plus_rate += (*directions[m].causes)[c] * plus;
      out[m].minus_rate += (*directions[m].causes)[c] * minus;
    }
  }
}

void tangents(const KineticConstants& k, const DomainColumns& domains, std::size_t count,
              const TangentStep& step, const std::vector<FractionTangents>& directions,
              std::vector<MeanTangents>& out) {
  with_law(k, [&](auto law, auto n) {
    tangents_with<decltype(law), n>(k, domains, count, step, directions, out);
  });
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

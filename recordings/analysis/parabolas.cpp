#include "recordings/analysis/parabolas.h"

#include <vector>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "recordings/analysis/parabolas.cpp"
#include <hwy/foreach_target.h>
// The order matters: the line above makes this file be read once for each instruction set.
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace ferrobench::recordings::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// out[i] = (centre y[i] + sum over k of weights[k - 1] (y[i - k] + y[i + k])) / total; how many have been
// done. Four sums at a time stay in registers. No fused multiply-add, which not every processor has.
std::size_t weighted(const double* y, double centre, std::span<const double> weights, double total,
                     std::span<double> out) {
  const hn::ScalableTag<double> d;
  const std::size_t n = hn::Lanes(d);
  const auto most = hn::Set(d, centre), whole = hn::Set(d, total);
  std::size_t i = 0;
  for (; i + 4 * n <= out.size(); i += 4 * n) {
    auto a = hn::Mul(most, hn::LoadU(d, y + i)), b = hn::Mul(most, hn::LoadU(d, y + i + n)),
         c = hn::Mul(most, hn::LoadU(d, y + i + 2 * n)), e = hn::Mul(most, hn::LoadU(d, y + i + 3 * n));
    for (std::size_t k = 1; k <= weights.size(); ++k) {
      const auto weight = hn::Set(d, weights[k - 1]);
      const double *before = y + i - k, *after = y + i + k;
      const auto add = [&](auto& sum, std::size_t at) HWY_ATTR {
        sum = hn::Add(sum, hn::Mul(weight, hn::Add(hn::LoadU(d, before + at), hn::LoadU(d, after + at))));
      };
      add(a, 0), add(b, n), add(c, 2 * n), add(e, 3 * n);
    }
    hn::StoreU(hn::Div(a, whole), d, out.data() + i);
    hn::StoreU(hn::Div(b, whole), d, out.data() + i + n);
    hn::StoreU(hn::Div(c, whole), d, out.data() + i + 2 * n);
    hn::StoreU(hn::Div(e, whole), d, out.data() + i + 3 * n);
  }
  return i;
}

}  // namespace ferrobench::recordings::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ferrobench::recordings {

HWY_EXPORT(weighted);

// The weights are the same everywhere, w(x) = (s4 - s2 x^2) / (s0 s4 - s2^2) with sn = sum of x^n over
// x = -half..half.
void parabolas(const double* y, std::size_t half, std::span<double> out) {
  double s0 = 1, s2 = 0, s4 = 0;
  for (std::size_t k = 1; k <= half; ++k) {
    const auto x2 = static_cast<double>(k * k);
    s0 += 2, s2 += 2 * x2, s4 += 2 * x2 * x2;
  }
  std::vector<double> weights;
  for (std::size_t k = 1; k <= half; ++k) weights.push_back(s4 - s2 * static_cast<double>(k * k));
  const double total = s0 * s4 - s2 * s2;
  for (auto i = HWY_DYNAMIC_DISPATCH(weighted)(y, s4, weights, total, out); i < out.size(); ++i) {
    double sum = s4 * y[i];
    for (std::size_t k = 1; k <= half; ++k) sum += weights[k - 1] * (*(y + i - k) + y[i + k]);
    out[i] = sum / total;
  }
}

}  // namespace ferrobench::recordings
#endif

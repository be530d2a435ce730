#include "tests/bench/exp_limit.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "tests/bench/exp_limit.cpp"
#include <hwy/foreach_target.h>
// The order matters: the line above makes this file be read once for each instruction set.
#include <hwy/contrib/math/math-inl.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace ferrobench::bench::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

void exp_all(const double* in, double* out, std::size_t count) {
  const hn::ScalableTag<double> d;
  for (std::size_t i = 0; i < count; i += hn::Lanes(d))
    hn::StoreU(hn::Exp(d, hn::LoadU(d, in + i)), d, out + i);
}

}  // namespace ferrobench::bench::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ferrobench::bench {

HWY_EXPORT(exp_all);

void vector_exp(const double* in, double* out, std::size_t count) {
  HWY_DYNAMIC_DISPATCH(exp_all)(in, out, count);
}

}  // namespace ferrobench::bench
#endif

#include "model/wide_surroundings.h"

// It takes long to compile, and vectors are no wider in these than in those that are left.
#define HWY_DISABLED_TARGETS (HWY_SSSE3 | HWY_SSE4 | HWY_AVX3_DL)
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "model/wide_surroundings.cpp"
#include <hwy/foreach_target.h>
// The order matters: the line above makes this file be read once for each instruction set.
#include <hwy/highway.h>

#include "model/physics/mechanics-inl.h"

// All that is called becomes part of this function, and so is compiled for its instruction set; what is
// virtual does not, nor what Mechanics solves by iteration, which would compile for minutes.
HWY_BEFORE_NAMESPACE();
namespace ferrobench::model::HWY_NAMESPACE {

using wide::Number;

HWY_FLATTEN void sense(Surroundings<Number>& around, const Trial<Number>& trial, const Number& since,
                       Sensed<Number>& out) {
  out = around.sense(trial, since);
}

}  // namespace ferrobench::model::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ferrobench::model {

HWY_EXPORT(sense);

void wide::sense(Surroundings<Number>& around, const Trial<Number>& trial, const Number& since,
                 Sensed<Number>& out) {
  HWY_DYNAMIC_DISPATCH(sense)(around, trial, since, out);
}

}  // namespace ferrobench::model
#endif

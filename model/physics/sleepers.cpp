#include "model/physics/sleepers.h"

#include <array>
#include <bit>
#include <cstdint>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "model/physics/sleepers.cpp"
#include <hwy/foreach_target.h>
// The order matters: the line above makes this file be read once for each instruction set.
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace ferrobench::model::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;
using D = hn::ScalableTag<double>;

// The rows of first .. end for whose vectors `wanted` gives a mask.
template <class Wanted>
HWY_INLINE std::size_t find(std::size_t first, std::size_t end, std::size_t* rows, const Wanted& wanted) {
  const D d;
  static_assert(hn::MaxLanes(d) <= 8);  // one byte holds a mask
  std::size_t found = 0;
  for (std::size_t i = first; i < end; i += hn::Lanes(d)) {
    std::array<std::uint8_t, 8> bytes{};  // as many as StoreMaskBits may write
    hn::StoreMaskBits(d, hn::And(wanted(i), hn::FirstN(d, end - i)), bytes.data());
    for (unsigned bits = bytes[0]; bits != 0; bits &= bits - 1)
      rows[found++] = i + static_cast<std::size_t>(std::countr_zero(bits));
  }
  return found;
}

std::size_t due(const SleepBounds& bounds, std::size_t first, std::size_t end, const SleepState& at,
                std::size_t* rows) {
  const D d;
  const auto field = hn::Set(d, at.field), path = hn::Set(d, at.stress_path), time = hn::Set(d, at.time);
  return find(first, end, rows, [&](std::size_t i) HWY_ATTR {
    return hn::Not(hn::And(hn::And(hn::Gt(field, hn::LoadU(d, bounds.low_field + i)),
                                   hn::Lt(field, hn::LoadU(d, bounds.high_field + i))),
                           hn::And(hn::Lt(path, hn::LoadU(d, bounds.stress_path + i)),
                                   hn::Lt(time, hn::LoadU(d, bounds.time + i)))));
  });
}

std::size_t quiet(const double* falling, const double* rising, std::size_t count, const QuietLimits& limits,
                  std::size_t* rows) {
  const D d;
  const auto most_falling = hn::Set(d, limits.falling), most_rising = hn::Set(d, limits.rising);
  const auto most = hn::Set(d, limits.sum);
  return find(0, count, rows, [&](std::size_t i) HWY_ATTR {
    const auto f = hn::LoadU(d, falling + i), r = hn::LoadU(d, rising + i);
    return hn::And(hn::And(hn::Lt(f, most_falling), hn::Lt(r, most_rising)), hn::Lt(hn::Add(f, r), most));
  });
}

}  // namespace ferrobench::model::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ferrobench::model {

HWY_EXPORT(due);
HWY_EXPORT(quiet);

std::size_t find_due(const SleepBounds& bounds, std::size_t first, std::size_t end, const SleepState& at,
                     std::size_t* rows) {
  return HWY_DYNAMIC_DISPATCH(due)(bounds, first, end, at, rows);
}

std::size_t find_quiet(const double* falling, const double* rising, std::size_t count,
                       const QuietLimits& limits, std::size_t* rows) {
  return HWY_DYNAMIC_DISPATCH(quiet)(falling, rising, count, limits, rows);
}

}  // namespace ferrobench::model
#endif

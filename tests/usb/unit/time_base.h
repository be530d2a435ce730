// The unit's own time: ticks of its 64 MHz oscillator, which only its owner advances.
#pragma once

#include <cstdint>
#include <limits>

namespace ferrobench::emulator {

using Ticks = std::uint64_t;
inline constexpr Ticks ticks_per_second = 64'000'000;
inline constexpr Ticks never = std::numeric_limits<Ticks>::max();

}  // namespace ferrobench::emulator

// Factors between the units people write at the edge and the SI units used everywhere inside, and what nature
// gives.
#pragma once

namespace ferrobench {

inline constexpr double volts_per_m_in_kv_per_mm = 1e6;
inline constexpr double pascal_in_mpa = 1e6;
inline constexpr double newton_per_m_in_n_per_um = 1e6;
inline constexpr double metre_in_um = 1e-6;

inline constexpr double vacuum_permittivity = 8.8541878128e-12;  // F/m, CODATA 2018

}  // namespace ferrobench

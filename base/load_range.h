// What a specimen may be said to work against: in a model, a protocol, a setting of a run, a device's
// configuration or an import. Who reads a recording takes every prestress, since files stay what they are.
#pragma once

namespace ferrobench {

// Compression is positive. Piezoceramics break at about 0.1 GPa of tension and 1 GPa of compression: what
// lies far outside was given in another unit.
inline constexpr double prestress_min = -1e9;  // Pa
inline constexpr double prestress_max = 1e10;  // Pa

// The stiffest anvil of 1 m^2 does not reach this.
inline constexpr double spring_stiffness_max = 1e12;  // N/m

}  // namespace ferrobench

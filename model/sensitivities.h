// Forward sensitivities: a trajectory together with its derivatives by parameters of the model.
//
// The simulation is the plain one, bit for bit. Beside each step that it accepts the derivatives are taken
// along: through the kernel (physics/kernel_tangents.h), and through amplifier, mechanics, effects and
// sensors by the same source with numbers that carry tangents (physics/dual.h). Where loads and fractions
// depend on each other the implicit function theorem is applied at the step's end, not to the iterations.
// What the values alone decide is held: the steps as shares of their piece of field, which domains take part,
// the lattice's nodes. So these are the derivatives of the numerical solution, as good as that itself.
//
// At kinks the slope is one-sided, that of the branch which the values take: a displacement at its clipping
// limit, a spring that meets or leaves its gap, an amplifier that begins or ends to slew, a friction that
// turns round, a fraction that is kept from leaving [0, 1]. A spread of zero, to which all answers are even,
// has the slope 0.
#pragma once

#include <span>
#include <string>

#include "model/simulator.h"

namespace ferrobench::model {

// Each either empty (not wanted) or times x parameters, row by row: d channel(times[i]) / d parameter[j] at
// [i * parameters + j], in the channel's unit per unit of the parameter. Directions of the drive count as
// parameters, and come after them.
struct SlopeSpans {
  std::span<double> field, charge, displacement, force;
};

// Directions in which the drive itself moves: d knot_time[k] / d direction[j] in s and d knot_field[k] /
// d direction[j] in V/m, at [k * count + j]. `time` may be empty: the knots stay where they are.
// Levels that were visited before time 0, the past, do not move, the first knot included then.
struct DriveDirections {
  std::size_t count = 0;
  std::span<const double> time, field;
};

// simulate_at() with slopes by `parameters`, paths as in inference/parameters, followed by those by the
// directions of `drive`: parameters + directions a row. Error(invalid_params) if the model has no such number
// or `drive` is not as long as it must be.
SimulationStatistics simulate_with_slopes(const Model& model, std::span<const std::string> parameters,
                                          std::span<const double> knot_time,
                                          std::span<const double> knot_field, std::span<const double> times,
                                          const ChannelSpans& out, const SlopeSpans& slopes,
                                          const SimulationOptions& options = {},
                                          const DriveDirections& drive = {});

}  // namespace ferrobench::model

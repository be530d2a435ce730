// First-order reversal curves: from the upper level the field falls to a reversal E_r and rises again to E.
//
//   rho(E_r, E) = -1/2 d2P / (dE_r dE)   [C/m^2 / (V/m)^2]
//
// by least squares of a second-degree polynomial over the (2 s + 1)^2 points of the grid around, s the
// smoothing (Pike, Roberts and Verosub, J. Appl. Phys. 85, 1999). Each curve counts from its own value at the
// upper level, so that a charge that drifts from curve to curve does no harm.
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "recordings/analysis/cycles.h"
#include "recordings/format/recording.h"

namespace ferrobench::recordings {

struct Forc {
  std::vector<double> reversal;                   // E_r, V/m, rising
  std::vector<double> field;                      // E, V/m, rising: an even grid up to the upper level
  std::vector<std::vector<double>> polarization;  // C/m^2, [reversal][field]; NaN below the reversal
  std::vector<std::vector<double>> density;       // likewise; NaN where too few points lie around
  std::size_t smoothing = 0;
};

// None unless the recording has charge, and at least eight cycles of one turn each whose reversals go one
// way.
std::optional<Forc> find_forc(const Recording& recording, const std::vector<Cycle>& cycles,
                              std::size_t smoothing = 3);

}  // namespace ferrobench::recordings

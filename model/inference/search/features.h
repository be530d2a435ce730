// A start from what the loops themselves show.
//
// - Coercive fields E+, E-, where the charge passes the middle of its range: bias field = -(E+ + E-) / 2.
// - Half their distance, E_c, at two rates or more: barrier and activation volume, from a domain that
//   switches when its rate times the time t that it has is one (4.23, 4.25):
//   E_c = (4 dg0 / P_r) (1 - sqrt(ln(t / tau) k T / (V dg0))).
// - The field between a quarter and three quarters of the switching: 1.35 standard deviations of the
//   interaction fields.
// - The charge between the branches at E = 0: P_r.
// - Slopes on the way down from the largest field: kappa_180 and d.
// - The depth of the displacement's loop below E = 0: eps_90, with a quarter of the domains in the 90 well.
//
// Each is good to a factor of two or so, which is what a search begins with; tau keeps its value.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "model/inference/dataset/recording_data.h"
#include "model/inference/parameters/parameters.h"

namespace ferrobench::model {

// `start` with those of the `free` parameters that the recordings show. Empty if none has a loop through both
// coercive fields with its charge.
std::optional<Model> start_from_features(const Model& start, const std::vector<FreeParameter>& free,
                                         std::span<const RecordingData> data);

}  // namespace ferrobench::model

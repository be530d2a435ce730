// The split of a data set into recordings that are learned from and recordings that are held out (locked
// away) for the proof.
#pragma once

#include <set>
#include <vector>

#include "model/inference/dataset/bench.h"

namespace ferrobench::model::inference {

// Which recordings to hold out: about a quarter of them (none of fewer than three), chosen greedily so that
// every kind of segment, every load and every decade of duration stays on both sides as far as that goes.
// `never` holds indices of recordings that must be learned from.
std::vector<bool> choose_held_out(const std::vector<BenchRecording>& recordings,
                                  const std::set<std::size_t>& never = {});

}  // namespace ferrobench::model::inference

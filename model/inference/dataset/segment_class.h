// The kinds of segment that the rows of a recording lie in. Effects show in some of them and not in others,
// so they say where a model misses, and a train/test split has to have all of them on both sides.
#pragma once

#include <cstddef>
#include <string_view>

#include "model/model.h"
#include "model/simulator.h"

namespace ferrobench::model::inference {

enum class SegmentClass {
  rest,
  hold_early,
  hold_late,
  after_reversal,
  ramp_before_switching,
  ramp_switching,
  ramp_after_switching
};
inline constexpr std::size_t segment_class_count = 7;
std::string_view segment_class_name(SegmentClass segment);

struct BenchRecording;
// Puts each row into its class, by the drive and by where the model, simulated `roughly`, switches.
void classify_segments(BenchRecording& recording, const Model& model, const SimulationOptions& roughly);

}  // namespace ferrobench::model::inference

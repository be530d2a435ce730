// The channel of a sensor, in which alone an effect of that sensor can be seen: whatever a wrong model of the
// specimen leaves in the others says nothing about the effect.
#pragma once

#include <optional>
#include <vector>

#include "model/inference/selection/verdict.h"
#include "model/inference/study/validation.h"

namespace ferrobench::model::inference {

// Empty for effects that are not a sensor's.
std::optional<recordings::Channel> channel_of(Family sensor);

// The misses of `recordings` (measured less simulated, over noise), by two models.
struct Misses {
  const std::vector<BenchRecording>& bench;
  const std::vector<std::vector<NoiseModel>>& noise;
  const std::vector<std::size_t>& recordings;
  const Signals &before, &after;
};

// The sum of squares above the noise's in this channel.
ExcessTaken excess_taken(const Misses& of, recordings::Channel channel);
// The sum of squares of what differs in this channel.
double squares_of_change(const Misses& of, recordings::Channel channel);

// Displacement and force are two views of one motion. Whether the force still misses, in proportion to its
// range, more than half of what changed in the displacement, or the other way round: then it is the motion
// that the model lacks, and no sensor. False where only one of them was measured.
bool is_of_the_motion(const Misses& of, recordings::Channel channel);

}  // namespace ferrobench::model::inference

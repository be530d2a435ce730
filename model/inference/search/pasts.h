// What a specimen had been through before a recording whose past nobody wrote down: the likeliest of
//
//   poled towards +, poled towards -, unpoled
//   cycled: the program itself until it repeats, from each of these, or from a specimen partly poled; the
//   degree is a free number
//   visited: from the far side, or unpoled, to one extreme level and back, at the recording's own pace; the
//   level is a free number
//
// by -2 ln L = n ln(sum of squares) + k ln(n), with k free numbers and n rows that are independent of each
// other (what a model misses goes together over many samples). A free level has to halve the sum of squares,
// n ln 2 more: where a model is wrong, a level that nobody set makes up for it. A degree of poling has not:
// each specimen has one, and cycles that do not saturate it leave much of it.
//
// Near a start neither the polarization nor the strain is right yet, so the height of each channel is free;
// the coercive fields and which way the first ramp goes tell the pasts apart all the same.
#pragma once

#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "model/inference/dataset/recording_data.h"
#include "model/inference/residuals/residual_model.h"

namespace ferrobench::model {

struct FittedPast {
  std::string recording;  // its title, or the name that it was given by
  protocols::Past past;
  bool chosen = false;  // as the likeliest; else the recording says so itself
};

struct PastChoice {
  Fidelity fidelity;
  bool heights_are_free = false;
  bool cycled_alone = false;  // no other kind
  // Taken for all, unless it leaves much of a recording where another past leaves less than half as much of
  // the sum of squares: the model may be wrong in more than the past.
  std::optional<protocols::Past> presumed{};
  std::function<void()> count{};  // before each simulation, from several threads; may throw
};

// One for each recording: as it is recorded, else the likeliest under any of the models; what it was before
// where none of the models can be simulated.
std::vector<protocols::Past> choose_pasts(std::span<const Model> models, std::span<const RecordingData> data,
                                          const PastChoice& choice);

}  // namespace ferrobench::model

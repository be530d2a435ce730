// Recordings of a specimen that nothing pushes against, as a separable problem (residuals/separable.h).
#pragma once

#include <optional>

#include "model/inference/dataset/recording_data.h"
#include "model/inference/residuals/separable.h"

namespace ferrobench::model {

// The channels at a recording's rows; fractions and field too.
struct SimulatedRows {
  std::vector<double> field, charge, displacement, force, plus, minus;
  const std::vector<double>& at(recordings::Channel channel) const;
};
// Empty where the model could not be simulated. Throws Error(cancelled).
std::optional<SimulatedRows> simulate_recorded(const Model& model, const RecordingData& data,
                                               const Fidelity& fidelity);

// Times a difference in SI: percent of the range, over the root of the number of rows.
double residual_scale(const MeasuredColumn& column);

// Null if a spring pushes, if the model has effects (some change what enters linearly), or if not all of the
// parameters that go into the groups are free. `data` must outlive it.
std::unique_ptr<Separable> free_specimen(const Model& model, const std::vector<FreeParameter>& free,
                                         const std::vector<RecordingData>& data);

}  // namespace ferrobench::model

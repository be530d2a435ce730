// A recording's rows as a model gives them.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "model/inference/dataset/recording_data.h"
#include "model/inference/residuals/residual_model.h"

namespace ferrobench::model {

// The channels at a recording's rows; fractions and field too.
struct SimulatedRows {
  std::vector<double> field, charge, displacement, force, plus, minus;
  const std::vector<double>& at(recordings::Channel channel) const;
  // d channel / d parameter at [row * parameters + parameter], if they were asked for.
  std::vector<double> charge_slopes, displacement_slopes, force_slopes;
  const std::vector<double>& slopes_at(recordings::Channel channel) const;
};
// `model` as it stands for the recording (model_for). With slopes by `parameters`, paths of the model's
// numbers. After the recording's past, or another one. Empty where the model could not be simulated. Throws
// Error(cancelled).
std::optional<SimulatedRows> simulate_recorded(const Model& model, const RecordingData& data,
                                               const Fidelity& fidelity,
                                               std::span<const std::string> parameters = {},
                                               const protocols::Past* past = nullptr);

// The same of each recording under its own specimen and load, several at a time.
std::vector<std::optional<SimulatedRows>> simulate_each_recorded(
    const Model& model, std::span<const RecordingData> data, const Fidelity& fidelity,
    std::span<const std::string> parameters = {});

// Times a difference in SI: percent of the range, or MeasuredColumn::error, over the root of the number of
// rows.
double residual_scale(const MeasuredColumn& column);

}  // namespace ferrobench::model

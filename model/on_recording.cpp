#include "model/on_recording.h"

#include <cmath>

namespace ferrobench::model {

using recordings::Channel;

Model model_for(const Model& model, const recordings::Header& recording) {
  Model out = model;
  const auto& specimen = recording.specimen;
  out.actuator.length = specimen.length;
  out.actuator.area = specimen.area;
  out.actuator.layer_thickness = specimen.layer_thickness;
  out.actuator.layer_count = specimen.layer_count;
  out.load.spring_stiffness = recording.load.spring_stiffness;
  out.load.prestress = recording.load.prestress;
  return out;
}

std::vector<double> played_field(const recordings::Recording& recording) {
  const auto source = recording.has(Channel::command) ? Channel::command : Channel::field;
  if (!recording.has(source))
    throw Error(ErrorCode::bad_recording, "there is no field to play",
                Problem{.path = "/entry/data", .message = "has neither command nor field"});
  auto drive = recording.at(source);
  std::size_t last = drive.size();  // the last finite one so far
  for (std::size_t i = 0; i < drive.size(); ++i) {
    if (!std::isfinite(drive[i])) continue;
    const std::size_t from = last < drive.size() ? last : i;
    for (std::size_t k = last < drive.size() ? last + 1 : 0; k < i; ++k)
      drive[k] = from == i
                     ? drive[i]
                     : drive[from] + (drive[i] - drive[from]) * (recording.time[k] - recording.time[from]) /
                                         (recording.time[i] - recording.time[from]);
    last = i;
  }
  if (last == drive.size())
    throw Error(ErrorCode::bad_recording, "the field is nothing but gaps",
                Problem{.path = "/entry/data/" + std::string(channel_name(source)),
                        .message = "has no finite value"});
  for (std::size_t k = last + 1; k < drive.size(); ++k) drive[k] = drive[last];
  return drive;
}

Trajectory simulate_on(const Model& model, const recordings::Recording& recording,
                       const SimulationOptions& options, bool estimate_quadrature) {
  auto after = options;
  if (after.past == nullptr) after.past = &recording.header.past;
  return simulate(model_for(model, recording.header), recording.time, played_field(recording), after,
                  estimate_quadrature);
}

const std::vector<double>& channel_of(const Trajectory& t, Channel channel) {
  switch (channel) {
    case Channel::charge:
      return t.charge;
    case Channel::displacement:
      return t.displacement;
    case Channel::force:
      return t.force;
    default:
      return t.field;
  }
}

}  // namespace ferrobench::model

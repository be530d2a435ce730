#include "server/engine/simulation.h"

#include <boost/uuid/random_generator.hpp>
#include <boost/uuid/uuid_io.hpp>
#include <cmath>

#include "model/simulator.h"
#include "recordings/iso_time.h"

namespace ferrobench::server {

using recordings::Channel;

namespace {

// A gap has no command; the output is taken to go straight across it.
std::vector<double> without_gaps(std::vector<double> values, const std::vector<double>& time) {
  std::size_t last = values.size();  // none yet
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (std::isnan(values[i])) continue;
    for (std::size_t j = last == values.size() ? 0 : last + 1; j < i; ++j)
      values[j] = last == values.size() ? values[i]
                                        : values[last] + (values[i] - values[last]) * (time[j] - time[last]) /
                                                             (time[i] - time[last]);
    last = i;
  }
  for (std::size_t j = last == values.size() ? last : last + 1; j < values.size(); ++j)
    values[j] = values[last];
  return values;
}

model::Model model_for(const recordings::Recording& recording, const nlohmann::json& given) {
  const auto& json = given.is_null() ? recording.header.model : given;
  if (json.is_null())
    throw Error(ErrorCode::invalid_params, "there is no model to simulate with",
                Problem{.path = "/model",
                        .message = "is missing, and the recording names none",
                        .hint = "give one: --model NAME or FILE"});
  auto model = model::model_from_json(json);
  const auto& s = recording.header.specimen;
  model.actuator.length = s.length;
  model.actuator.area = s.area;
  model.actuator.layer_thickness = s.layer_thickness;
  model.actuator.layer_count = s.layer_count;
  model.load.prestress = recording.header.load.prestress;
  model.load.spring_stiffness = recording.header.load.spring_stiffness;
  return model;
}

}  // namespace

Simulation simulate_recording(const recordings::Recording& recording, const nlohmann::json& given,
                              const std::string& origin) {
  const bool commanded = recording.has(Channel::command);
  if (recording.size() == 0 || (!commanded && !recording.has(Channel::field)))
    throw Error(ErrorCode::invalid_params, "the recording has nothing to play",
                Problem{.path = "/data", .message = "has neither command nor field"});
  const auto model = model_for(recording, given);
  const auto drive =
      without_gaps(recording.at(commanded ? Channel::command : Channel::field), recording.time);
  auto trajectory = model::simulate(model, recording.time, drive, {}, true);

  Simulation out;
  out.time_error = trajectory.time_error;
  out.quadrature_error = trajectory.quadrature_error;
  auto& r = out.recording;
  r.header = recording.header;
  r.header.start_time = recordings::iso_now();
  r.header.entry_identifier = to_string(boost::uuids::random_generator()());
  r.header.run_seed.reset();
  r.header.model = model::to_json(model);
  r.header.device = {{"driver", "simulation"},
                     {"source", origin},
                     {"source_identifier", recording.header.entry_identifier},
                     {"played", commanded ? "command" : "field"},
                     {"time_error", trajectory.time_error},
                     {"quadrature_error", trajectory.quadrature_error}};
  if (recording.header.charge_reference == recordings::ChargeReference::first_sample)
    for (const double first = trajectory.charge.front(); auto& q : trajectory.charge) q -= first;
  r.time = recording.time;
  r.set(Channel::command) = drive;
  r.set(Channel::field) = std::move(trajectory.field);
  r.set(Channel::charge) = std::move(trajectory.charge);
  r.set(Channel::displacement) = std::move(trajectory.displacement);
  r.set(Channel::force) = std::move(trajectory.force);
  r.segments = recording.segments;
  for (const auto channel : recordings::all_channels) r.noise.at(static_cast<std::size_t>(channel)) = 0.0;
  r.end_time = recordings::iso_after(r.header.start_time, r.time.back() - r.time.front())
                   .value_or(r.header.start_time);
  return out;
}

}  // namespace ferrobench::server

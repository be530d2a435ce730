#include "server/engine/simulation.h"

#include <boost/uuid/random_generator.hpp>
#include <boost/uuid/uuid_io.hpp>

#include "model/on_recording.h"
#include "recordings/format/iso_time.h"

namespace ferrobench::server {

using recordings::Channel;

Simulation simulate_recording(const recordings::Recording& recording, const nlohmann::json& model,
                              const std::string& origin, const std::optional<protocols::Past>& past,
                              const std::function<bool()>& stop) {
  const auto& chosen = model.is_null() ? recording.header.model : model;
  if (chosen.is_null())
    throw Error(ErrorCode::invalid_params, "there is no model to simulate with",
                Problem{.path = "/model",
                        .message = "is missing, and the recording names none",
                        .hint = "give one: --model NAME or FILE"});
  const auto adapted = model::model_for(model::model_from_json(chosen), recording.header);
  auto options = model::below_noise;
  if (stop) options.stop = &stop;
  auto before = past.value_or(recording.header.past);
  if (!before.known()) before = {protocols::PastKind::poled_plus};
  options.past = &before;
  auto trajectory = model::simulate_on(adapted, recording, options, true);
  const bool commanded = recording.has(Channel::command);

  Simulation out;
  out.time_error = trajectory.time_error;
  out.quadrature_error = trajectory.quadrature_error;
  auto& r = out.recording;
  r.header = recording.header;
  r.header.start_time = recordings::iso_now();
  r.header.entry_identifier = to_string(boost::uuids::random_generator()());
  r.header.run_seed.reset();
  r.header.past = before;
  r.header.model = model::to_json(adapted);
  r.header.device = {{"driver", "simulation"},
                     {"source", origin},
                     {"source_identifier", recording.header.entry_identifier},
                     {"played", commanded ? "command" : "field"},
                     {"time_error", trajectory.time_error},
                     {"quadrature_error", trajectory.quadrature_error}};
  if (recording.header.charge_reference == recordings::ChargeReference::first_sample)
    for (const double first = trajectory.charge.front(); auto& q : trajectory.charge) q -= first;
  r.time = recording.time;
  r.set(Channel::command) = recording.at(commanded ? Channel::command : Channel::field);
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

#include "model/inference/residuals/simulated_rows.h"

#include <tbb/parallel_for.h>

#include <cmath>

#include "model/on_recording.h"
#include "model/past.h"
#include "model/sensitivities.h"

namespace ferrobench::model {

using recordings::Channel;

namespace {

// Steps that a simulation may take for each knot and on top: twenty times what shipped models take. A search
// that strays into models stiffer than that turns back.
constexpr std::uint64_t steps_per_knot = 20, steps_at_least = 20000;

}  // namespace

const std::vector<double>& SimulatedRows::at(Channel channel) const {
  if (channel == Channel::charge) return charge;
  return channel == Channel::displacement ? displacement : force;
}

const std::vector<double>& SimulatedRows::slopes_at(Channel channel) const {
  if (channel == Channel::charge) return charge_slopes;
  return channel == Channel::displacement ? displacement_slopes : force_slopes;
}

double residual_scale(const MeasuredColumn& column) {
  const double unit = column.error > 0 ? column.error : 0.01 * column.range;
  return 1 / (unit * std::sqrt(static_cast<double>(column.rows.size())));
}

std::optional<SimulatedRows> simulate_recorded(const Model& model, const RecordingData& data,
                                               const Fidelity& fidelity,
                                               std::span<const std::string> parameters,
                                               const protocols::Past* past) {
  const auto& drive = fidelity.coarse ? data.simplified : data.drive;
  const auto n = data.time.size();
  SimulatedRows out;
  for (auto* column : {&out.field, &out.charge, &out.displacement, &out.force, &out.plus, &out.minus})
    column->resize(n);
  ChannelSpans spans;
  spans.field = out.field;
  spans.charge = out.charge;
  spans.displacement = out.displacement;
  spans.force = out.force;
  spans.fraction_plus = out.plus;
  spans.fraction_minus = out.minus;
  auto options = fidelity.simulation;
  options.past = past != nullptr ? past : &data.past;
  if (options.most_steps == 0)
    options.most_steps = steps_at_least + steps_per_knot * pieces_played(options.past, drive.time.size());
  try {
    if (parameters.empty()) {
      simulate_at(model, drive.time, drive.field, data.time, spans, options);
    } else {
      for (auto* slopes : {&out.charge_slopes, &out.displacement_slopes, &out.force_slopes})
        slopes->resize(n * parameters.size());
      simulate_with_slopes(model, parameters, drive.time, drive.field, data.time, spans,
                           {.field = {},
                            .charge = out.charge_slopes,
                            .displacement = out.displacement_slopes,
                            .force = out.force_slopes},
                           options);
    }
  } catch (const Error& e) {
    if (e.code() == ErrorCode::numerical || e.code() == ErrorCode::bad_model) return std::nullopt;
    throw;
  }
  return out;
}

std::vector<std::optional<SimulatedRows>> simulate_each_recorded(const Model& model,
                                                                 std::span<const RecordingData> data,
                                                                 const Fidelity& fidelity,
                                                                 std::span<const std::string> parameters) {
  std::vector<std::optional<SimulatedRows>> out(data.size());
  tbb::parallel_for(std::size_t{0}, data.size(), [&](std::size_t i) {
    out[i] = simulate_recorded(model_for(model, data[i].header), data[i], fidelity, parameters);
  });
  return out;
}

}  // namespace ferrobench::model

#include <algorithm>
#include <cmath>

#include "model/effects/catalogue.h"
#include "model/past.h"
#include "model/simulator_state.h"

namespace ferrobench::model {

// Fewer, longer pieces are faster.
std::vector<std::size_t> corners(std::span<const double> time, std::span<const double> field) {
  std::vector<std::size_t> out{0};
  double largest = 0;
  for (const double e : field) largest = std::max(largest, std::abs(e));
  const double slack = 1e-9 * std::max(largest, 1e-300);
  for (std::size_t i = 1; i + 1 < time.size(); ++i) {
    const std::size_t from = out.back();
    const double slope = (field[i] - field[from]) / (time[i] - time[from]);
    const double next = field[i] + slope * (time[i + 1] - time[i]);
    if (std::abs(next - field[i + 1]) > slack) out.push_back(i);
  }
  if (time.size() > 1) out.push_back(time.size() - 1);
  return out;
}

namespace {

void check(std::span<const double> time, std::span<const double> field) {
  if (time.size() != field.size() || time.empty())
    throw Error(ErrorCode::invalid_params, "time and field must be equally long and not empty",
                Problem{.path = "/field",
                        .message = "has another length",
                        .given = field.size(),
                        .allowed = time.size()});
  for (std::size_t i = 0; i < time.size(); ++i) {
    if (!std::isfinite(field[i]) || !std::isfinite(time[i]))
      throw Error(ErrorCode::invalid_params, "time and field must be finite",
                  Problem{.path = "/field/" + std::to_string(i), .message = "is not a number"});
    if (i > 0 && time[i] <= time[i - 1])
      throw Error(ErrorCode::invalid_params, "time must rise",
                  Problem{.path = "/time/" + std::to_string(i),
                          .message = "does not rise",
                          .given = time[i],
                          .unit = "s"});
  }
}

double rms_over_range(const std::vector<double>& a, const std::vector<double>& b) {
  double sum = 0, low = a.front(), high = a.front();
  for (std::size_t i = 0; i < a.size(); ++i) {
    sum += (a[i] - b[i]) * (a[i] - b[i]);
    low = std::min(low, a[i]);
    high = std::max(high, a[i]);
  }
  return high > low ? std::sqrt(sum / static_cast<double>(a.size())) / (high - low) : 0;
}

}  // namespace

Trajectory simulate(const Model& model, std::span<const double> time, std::span<const double> field,
                    const SimulationOptions& options, bool estimate_quadrature) {
  check(time, field);
  const std::size_t n = time.size();
  Trajectory out;
  for (auto* column : {&out.field, &out.charge, &out.displacement, &out.force}) column->resize(n);
  std::vector<double> since(n), knot_time, knot_field;
  for (std::size_t i = 0; i < n; ++i) since[i] = time[i] - time[0];
  for (const std::size_t knot : corners(time, field)) {
    knot_time.push_back(since[knot]);
    knot_field.push_back(field[knot]);
  }
  ChannelSpans spans;
  spans.field = out.field;
  spans.charge = out.charge;
  spans.displacement = out.displacement;
  spans.force = out.force;
  out.time_error = simulate_at(model, knot_time, knot_field, since, spans, options).time_error;
  if (estimate_quadrature) {
    auto other = options;
    other.shift = options.shift + 1;
    const auto second = simulate(model, time, field, other, false);
    // Both shifts err independently: each by the difference over sqrt(2).
    out.quadrature_error = std::max(rms_over_range(out.charge, second.charge),
                                    rms_over_range(out.displacement, second.displacement)) /
                           std::sqrt(2.0);
  }
  return out;
}

void play_knots(Simulator::State& state, std::span<const double> knot_time,
                std::span<const double> knot_field, std::span<const double> times, const ChannelSpans& out,
                const std::function<void(std::size_t)>& begin) {
  check(knot_time, knot_field);
  start_after(state, knot_time, knot_field);
  std::size_t done = 0;
  for (std::size_t k = knot_time.size() > 1 ? 1 : 0; k < knot_time.size(); ++k) {
    const double end = knot_time[k];
    std::size_t next = done;
    while (next < times.size() && (times[next] <= end || k + 1 == knot_time.size())) ++next;
    const auto part = [&](std::span<double> column) {
      return column.empty() ? column : column.subspan(done, next - done);
    };
    const ChannelSpans spans{.field = part(out.field),
                             .charge = part(out.charge),
                             .displacement = part(out.displacement),
                             .force = part(out.force),
                             .polarization = part(out.polarization),
                             .strain = part(out.strain),
                             .stress = part(out.stress),
                             .fraction_plus = part(out.fraction_plus),
                             .fraction_minus = part(out.fraction_minus)};
    if (begin) begin(done);
    state.play(end - state.material.time, knot_field[k], times.subspan(done, next - done), spans);
    done = next;
  }
}

SimulationStatistics simulate_at(const Model& model, std::span<const double> knot_time,
                                 std::span<const double> knot_field, std::span<const double> times,
                                 const ChannelSpans& out, const SimulationOptions& options) {
  Simulator::State state(model, options);
  play_knots(state, knot_time, knot_field, times, out);
  return state.statistics;
}

Model without_sensors(Model model) {
  std::erase_if(model.effects, [](const auto& e) { return is_sensor(find_effect(e.id).family); });
  return model;
}

SimulationStatistics simulate_alike(std::span<const Model> models, std::span<const double> knot_time,
                                    std::span<const double> knot_field, std::span<const double> times,
                                    std::span<const ChannelSpans> out, const SimulationOptions& options) {
  if (models.size() == 1)
    return simulate_at(models.front(), knot_time, knot_field, times, out.front(), options);
  Simulator::State state(without_sensors(models.front()), options);
  for (std::size_t i = 0; i < models.size(); ++i) {
    auto sensors = models[i];
    std::erase_if(sensors.effects, [](const auto& e) { return !is_sensor(find_effect(e.id).family); });
    state.onlookers.push_back({{}, out[i]});
    install_effects(sensors, state.onlookers.back().ports);
  }
  play_knots(state, knot_time, knot_field, times, {}, [&](std::size_t done) { state.first_row = done; });
  return state.statistics;
}

}  // namespace ferrobench::model

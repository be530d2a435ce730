#include "model/fit/published.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "model/sensitivities.h"
#include "protocols/protocol.h"

namespace ferrobench::model {
namespace {

// They lie closer together after a corner, at cubes: strain goes on falling for a hundredth of a fast ramp
// after the field has turned, and samples 1/16 of the ramp apart read strokes of table 3.13 up to 0.4 %
// short.
constexpr int samples_per_segment = 32;
double share_of_segment(int sample) {
  const double share = static_cast<double>(sample) / samples_per_segment;
  return share * share * share;
}
// Of a channel's span, for differences along its derivative: far above rounding, far below any cell.
constexpr double share_moved = 1e-6;

using Run = PublishedExperiments::Run;

std::vector<Run> runs_of(const recordings::PublishedTable& table,
                         const std::map<std::string, double>& parameters) {
  const auto& description = table.description;
  const auto protocol = protocols::library_protocol(description.protocol);
  const auto load = protocol.load();
  protocols::ExpandOptions options;
  options.parameters = description.parameters.get<decltype(options.parameters)>();
  for (const auto& [name, value] : parameters)
    if (protocol.parameters().contains(name)) options.parameters[name] = value;
  const Run run{.waveform = {}, .spring_stiffness = load.spring_stiffness, .prestress = load.prestress};
  std::vector<Run> out;
  const auto add = [&](Run next, const protocols::ExpandOptions& of) {
    next.waveform = protocol.expand(of);
    out.push_back(std::move(next));
  };
  const auto* key = table.run_key();
  if (key == nullptr) add(run, options);
  for (const double value : table.run_values()) {
    auto next = run;
    auto of = options;
    if (key->kind == recordings::KeyKind::prestress)
      next.prestress = value * key->si;
    else
      of.parameters[key->setting] = value;
    add(std::move(next), of);
  }
  return out;
}

using recordings::Channel;
// Channels that cells of tables are read from, beside command and field.
constexpr std::array read_off{Channel::charge, Channel::displacement};

std::vector<double>& values(recordings::Recording& recording, Channel channel) {
  return recording.channels[static_cast<std::size_t>(channel)].value();
}

struct SimulatedRun {
  recordings::Recording recording;
  // Of each channel of `read_off`, times x parameters; empty if no parameter was named.
  std::array<std::vector<double>, read_off.size()> slopes;

  // With these channels moved along their derivatives.
  recordings::Recording moved(std::size_t parameter, std::size_t parameters, double by) const {
    auto out = recording;
    for (std::size_t c = 0; c < read_off.size(); ++c) {
      auto& channel = values(out, read_off.at(c));
      for (std::size_t i = 0; i < channel.size(); ++i)
        channel[i] += by * slopes.at(c)[i * parameters + parameter];
    }
    return out;
  }
  // By how much of a channel's span a parameter moves it, per unit of the parameter.
  double sensitivity(std::size_t parameter, std::size_t parameters) const {
    double out = 0;
    for (std::size_t c = 0; c < read_off.size(); ++c) {
      const auto& channel = recording.at(read_off.at(c));
      const auto [low, high] = std::ranges::minmax(channel);
      for (std::size_t i = 0; high > low && i < channel.size(); ++i)
        out = std::max(out, std::abs(slopes.at(c)[i * parameters + parameter]) / (high - low));
    }
    return out;
  }
};

// The run as a recording without noise, with a few samples to each segment and one at each of its ends.
SimulatedRun simulate_run(Model model, const Run& run, const SimulationOptions& options,
                          std::span<const std::string> parameters = {}) {
  if (run.spring_stiffness) model.load.spring_stiffness = *run.spring_stiffness;
  if (run.prestress) model.load.prestress = *run.prestress;
  SimulatedRun simulated;
  auto& out = simulated.recording;
  out.header.specimen = {model.name, model.actuator.length, model.actuator.area,
                         model.actuator.layer_thickness, model.actuator.layer_count};
  out.header.load = {model.load.spring_stiffness, model.load.prestress};

  const auto pieces = run.waveform.pieces();
  std::vector<double> knot_time{0}, knot_field{0};
  const auto knot = [&](double time, double field) {
    knot_time.push_back(time);
    knot_field.push_back(field);
  };
  if (pieces.front().from != 0) knot(1, pieces.front().from);
  const double origin = knot_time.back();
  std::vector<double> times{origin};
  for (const auto& piece : pieces) {
    const auto first = static_cast<std::int64_t>(times.size()) - 1;
    for (int k = 1; k <= samples_per_segment; ++k)
      times.push_back(origin + piece.start + piece.duration * share_of_segment(k));
    knot(times.back(), piece.to);
    const bool hold = piece.kind == protocols::PieceKind::hold;
    out.segments.push_back({first, static_cast<std::int64_t>(times.size()) - 1, hold ? "hold" : "ramp", "",
                            piece.to, hold ? 0 : piece.max_slew()});
  }
  const std::size_t n = times.size();
  for (const auto channel : {Channel::command, Channel::field}) out.set(channel).resize(n);
  for (const auto channel : read_off) out.set(channel).resize(n);
  ChannelSpans spans;
  spans.field = values(out, Channel::field);
  spans.charge = values(out, Channel::charge);
  spans.displacement = values(out, Channel::displacement);
  if (parameters.empty()) {
    simulate_at(model, knot_time, knot_field, times, spans, options);
  } else {
    for (auto& slopes : simulated.slopes) slopes.resize(n * parameters.size());
    simulate_with_slopes(
        model, parameters, knot_time, knot_field, times, spans,
        {.field = {}, .charge = simulated.slopes[0], .displacement = simulated.slopes[1], .force = {}},
        options);
  }
  for (std::size_t i = 0; i < n; ++i) {
    out.time.push_back(times[i] - origin);
    values(out, Channel::command)[i] = run.waveform.value(out.time.back());
  }
  for (auto& noise : out.noise) noise = 0;
  return simulated;
}

}  // namespace

PublishedExperiments::PublishedExperiments(const std::vector<std::string>& tables,
                                           const std::map<std::string, double>& parameters) {
  if (tables.empty()) throw Error(ErrorCode::invalid_params, "name at least one published table");
  for (const auto& name : tables) {
    auto table = recordings::published_table(name);
    auto group = std::ranges::find(groups_, table.description.protocol, &Group::protocol);
    if (group == groups_.end()) {
      groups_.push_back({table.description.protocol, runs_of(table, parameters), {}});
      group = groups_.end() - 1;
    }
    group->tables.push_back(std::move(table));
  }
}

std::vector<recordings::Comparison> PublishedExperiments::compare_all(const Recorded& recorded) const {
  std::vector<recordings::Comparison> out;
  for (std::size_t g = 0; g < groups_.size(); ++g)
    for (const auto& table : groups_[g].tables) out.push_back(compare(table, recorded[g]));
  return out;
}

std::vector<recordings::Comparison> PublishedExperiments::simulate(const Model& model,
                                                                   const SimulationOptions& options) const {
  Recorded recorded;
  for (const auto& group : groups_) {
    auto& list = recorded.emplace_back();
    for (const auto& run : group.runs) list.push_back(simulate_run(model, run, options).recording);
  }
  return compare_all(recorded);
}

PublishedExperiments::Neighbourhood PublishedExperiments::simulate_around(
    const Model& model, std::span<const std::string> parameters, const SimulationOptions& options) const {
  std::vector<std::vector<SimulatedRun>> runs;
  for (const auto& group : groups_) {
    auto& list = runs.emplace_back();
    for (const auto& run : group.runs) list.push_back(simulate_run(model, run, options, parameters));
  }
  const auto comparisons = [&](std::size_t parameter, double by) {
    Recorded recorded;
    for (const auto& group : runs) {
      auto& list = recorded.emplace_back();
      for (const auto& run : group)
        list.push_back(by == 0 ? run.recording : run.moved(parameter, parameters.size(), by));
    }
    return compare_all(recorded);
  };
  Neighbourhood out;
  out.here = comparisons(0, 0);
  for (std::size_t p = 0; p < parameters.size(); ++p) {
    double sensitivity = 0;
    for (const auto& group : runs)
      for (const auto& run : group)
        sensitivity = std::max(sensitivity, run.sensitivity(p, parameters.size()));
    const double step = sensitivity > 0 ? share_moved / sensitivity : 0;
    out.by.push_back({comparisons(p, -step), comparisons(p, step), 2 * step});
  }
  return out;
}

std::vector<recordings::PublishedTable> PublishedExperiments::tables() const {
  std::vector<recordings::PublishedTable> out;
  for (const auto& group : groups_) out.insert(out.end(), group.tables.begin(), group.tables.end());
  return out;
}

double PublishedExperiments::duration() const {
  double out = 0;
  for (const auto& group : groups_)
    for (const auto& run : group.runs) out = std::max(out, run.waveform.duration());
  return out;
}

double log_error(const recordings::ComparedCell& cell) {
  const double ratio = cell.measured.value_or(0) / cell.published.published;
  return 0.5 * std::log(ratio * ratio + 4e-4);
}

double weighted_error(const recordings::ComparedCell& cell) {
  return log_error(cell) / cell.published.uncertainty;
}

}  // namespace ferrobench::model

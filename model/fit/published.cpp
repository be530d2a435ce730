#include "model/fit/published.h"

#include <algorithm>
#include <cmath>

#include "protocols/protocol.h"

namespace ferrobench::model {
namespace {

constexpr int samples_per_segment = 16;

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

// The run as a recording without noise, with a few samples to each segment and one at each of its ends.
recordings::Recording simulate_run(Model model, const Run& run, const SimulationOptions& options) {
  using recordings::Channel;
  if (run.spring_stiffness) model.load.spring_stiffness = *run.spring_stiffness;
  if (run.prestress) model.load.prestress = *run.prestress;
  recordings::Recording out;
  out.header.specimen = {model.name, model.actuator.length, model.actuator.area,
                         model.actuator.layer_thickness, model.actuator.layer_count};
  out.header.load = {model.load.spring_stiffness, model.load.prestress};

  const auto pieces = run.waveform.pieces();
  Simulator simulator(model, options);
  simulator.start(0);
  if (pieces.front().from != 0) simulator.play(1.0, pieces.front().from, {}, {});
  const double origin = simulator.time();
  std::vector<double> times{origin};
  for (const auto& piece : pieces) {
    const auto first = static_cast<std::int64_t>(times.size()) - 1;
    for (int k = 1; k <= samples_per_segment; ++k)
      times.push_back(origin + piece.start + piece.duration * k / samples_per_segment);
    const bool hold = piece.kind == protocols::PieceKind::hold;
    out.segments.push_back({first, static_cast<std::int64_t>(times.size()) - 1, hold ? "hold" : "ramp", "",
                            piece.to, hold ? 0 : piece.max_slew()});
  }
  const std::size_t n = times.size();
  for (const auto channel : {Channel::command, Channel::field, Channel::charge, Channel::displacement})
    out.set(channel).resize(n);
  std::size_t done = 0;
  for (const auto& piece : pieces) {
    const std::size_t count = samples_per_segment + (done == 0 ? 1 : 0);
    const auto part = [&](Channel c) {
      return std::span(*out.channels[static_cast<std::size_t>(c)]).subspan(done, count);
    };
    ChannelSpans spans;
    spans.field = part(Channel::field);
    spans.charge = part(Channel::charge);
    spans.displacement = part(Channel::displacement);
    const auto when = std::span<const double>(times).subspan(done, count);
    simulator.play(piece.duration, piece.to, when, spans);
    for (std::size_t i = 0; i < count; ++i) part(Channel::command)[i] = piece.value(when[i] - origin);
    done += count;
  }
  for (const double t : times) out.time.push_back(t - origin);
  for (auto& noise : out.noise) noise = 0;
  return out;
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

std::vector<recordings::Comparison> PublishedExperiments::simulate(const Model& model,
                                                                   const SimulationOptions& options) const {
  std::vector<recordings::Comparison> out;
  for (const auto& group : groups_) {
    std::vector<recordings::Recording> recorded;
    for (const auto& run : group.runs) recorded.push_back(simulate_run(model, run, options));
    for (const auto& table : group.tables) out.push_back(compare(table, recorded));
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

#include <algorithm>
#include <cmath>
#include <map>

#include "model/fit/fit.h"
#include "protocols/common/units.h"
#include "protocols/protocol.h"
#include "recordings/tables/experiments.h"

namespace ferrobench::model {
namespace {

constexpr int samples_per_segment = 16;

// One run of a table, ready to simulate.
struct Run {
  protocols::Waveform waveform;
  std::optional<double> spring_stiffness, prestress;
};

std::vector<Run> runs_of(const std::string& table, const std::map<std::string, double>& parameters) {
  const auto& experiment = recordings::table_experiment(table);
  const auto protocol = protocols::library_protocol(experiment.protocol);
  std::vector<double> values;
  if (!experiment.key.empty())
    for (const auto& cell : recordings::published_table(table).cells)
      if (const double v = cell.key(experiment.key);
          std::find(values.begin(), values.end(), v) == values.end())
        values.push_back(v);
  const auto load = protocol.load();
  std::vector<Run> out;
  for (std::size_t i = 0; i < std::max<std::size_t>(1, values.size()); ++i) {
    protocols::ExpandOptions options;
    if (experiment.rate) options.parameters["rate"] = *experiment.rate;
    for (const auto& [name, value] : parameters)
      if (protocol.parameters().contains(name)) options.parameters[name] = value;
    Run run{.waveform = {}, .spring_stiffness = load.spring_stiffness, .prestress = load.prestress};
    if (experiment.setting == "prestress_MPa")
      run.prestress = values[i] * pascal_in_mpa;
    else if (!experiment.setting.empty())
      options.parameters[std::string(experiment.setting)] = values[i];
    run.waveform = protocol.expand(options);
    out.push_back(std::move(run));
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

class TableTarget final : public FitTarget {
 public:
  TableTarget(const std::vector<std::string>& tables, const std::map<std::string, double>& parameters) {
    for (const auto& name : tables) {
      const auto table = recordings::published_table(name);
      const auto& experiment = recordings::table_experiment(name);
      auto& group = groups_[std::string(experiment.protocol)];
      if (group.runs.empty()) group.runs = runs_of(name, parameters);
      group.tables.push_back(table);
      size_ += table.cells.size();
      if (experiment.key == "prestress_MPa" && table.cells.front().quantity.starts_with("displacement"))
        size_ += trends(table).size();
    }
  }

  std::size_t size() const override { return size_; }

  void residuals(const Model& model, const SimulationOptions& options, std::span<double> out) const override {
    std::size_t next = 0;
    for (const auto& [protocol, group] : groups_) {
      const auto recorded = simulate_all(model, group, options);
      for (const auto& table : group.tables) {
        const auto comparison = compare(table, recorded);
        std::vector<double> logs;
        for (const auto& cell : comparison.cells) {
          // A change that passes through zero has no logarithm: floor at 2 % of the published one.
          const double ratio = cell.measured.value_or(0) / cell.published.published;
          logs.push_back(0.5 * std::log(ratio * ratio + 4e-4));
          out[next++] = (table.name == "3.13" ? 50 : 1) * logs.back();
        }
        if (table.cells.front().quantity.starts_with("displacement_change"))
          for (const auto& [low, high] : trends(table)) out[next++] = against_trend(table, logs, low, high);
      }
    }
  }

  std::vector<std::pair<std::string, double>> summary(const Model& model,
                                                      const SimulationOptions& options) const override {
    std::vector<std::pair<std::string, double>> out;
    for (const auto& [protocol, group] : groups_) {
      const auto recorded = simulate_all(model, group, options);
      for (const auto& table : group.tables)
        for (const auto& [quantity, error] : compare(table, recorded).rms_log_error)
          out.emplace_back("table " + table.name + ", " + quantity, error);
    }
    return out;
  }

 private:
  struct Group {
    std::vector<Run> runs;
    std::vector<recordings::PublishedTable> tables;
  };

  static std::vector<recordings::Recording> simulate_all(const Model& model, const Group& group,
                                                         const SimulationOptions& options) {
    std::vector<recordings::Recording> out;
    for (const auto& run : group.runs) out.push_back(simulate_run(model, run, options));
    return out;
  }

  // Pairs of cells at the same reverse field and neighbouring prestress.
  static std::vector<std::pair<std::size_t, std::size_t>> trends(const recordings::PublishedTable& table) {
    std::vector<std::pair<std::size_t, std::size_t>> out;
    for (std::size_t i = 0; i < table.cells.size(); ++i) {
      std::optional<std::size_t> next;
      for (std::size_t j = 0; j < table.cells.size(); ++j) {
        const auto& a = table.cells[i];
        const auto& b = table.cells[j];
        if (a.key("field_kV_per_mm") >= 0 || a.key("field_kV_per_mm") != b.key("field_kV_per_mm")) continue;
        if (b.key("prestress_MPa") <= a.key("prestress_MPa")) continue;
        if (!next || b.key("prestress_MPa") < table.cells[*next].key("prestress_MPa")) next = j;
      }
      if (next) out.emplace_back(i, *next);
    }
    return out;
  }

  // Zero if the creep changes the published way by 4 % or more.
  static double against_trend(const recordings::PublishedTable& table, const std::vector<double>& logs,
                              std::size_t low, std::size_t high) {
    const double published = std::log(table.cells[high].published / table.cells[low].published);
    const double simulated = published + logs[high] - logs[low];
    return 4 * std::max(0.0, 0.04 - (published < 0 ? -simulated : simulated));
  }

  std::map<std::string, Group> groups_;
  std::size_t size_ = 0;
};

}  // namespace

std::unique_ptr<FitTarget> table_target(const std::vector<std::string>& tables,
                                        const std::map<std::string, double>& parameters) {
  if (tables.empty()) throw Error(ErrorCode::invalid_params, "name at least one table to fit");
  return std::make_unique<TableTarget>(tables, parameters);
}

recordings::Comparison simulate_table(const Model& model, const std::string& table,
                                      const SimulationOptions& options,
                                      const std::map<std::string, double>& parameters) {
  std::vector<recordings::Recording> recorded;
  for (const auto& run : runs_of(table, parameters)) recorded.push_back(simulate_run(model, run, options));
  return compare(recordings::published_table(table), recorded);
}

}  // namespace ferrobench::model

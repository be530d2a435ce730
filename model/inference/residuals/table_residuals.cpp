#include <algorithm>
#include <cmath>

#include "model/fit/published.h"
#include "model/inference/residuals/residual_model.h"

namespace ferrobench::model {
namespace {

class TableResiduals final : public ResidualModel {
 public:
  TableResiduals(const std::vector<std::string>& tables, const std::map<std::string, double>& parameters)
      : experiments_(tables, parameters) {
    for (const auto& table : experiments_.tables()) {
      const auto count = table.cells.size() + (has_trends(table) ? trends(table).size() : 0);
      parts_.push_back({"table " + table.name, size_, count, true});
      size_ += count;
    }
  }

  Solved evaluate(const Model& model, const Fidelity& fidelity, std::span<double> out) const override {
    std::size_t next = 0;
    auto bounded = fidelity.simulation;
    if (bounded.most_steps == 0)
      bounded.most_steps = fidelity.coarse ? most_steps_of_a_run : 50 * most_steps_of_a_run;
    std::vector<recordings::Comparison> comparisons;
    try {
      comparisons = experiments_.simulate(model, bounded);
    } catch (const Error& e) {
      if (e.code() == ErrorCode::numerical || e.code() == ErrorCode::bad_model) return Solved::no;
      throw;
    }
    for (const auto& [table, cells, scale, error] : comparisons) {
      std::vector<double> logs;
      for (const auto& cell : cells) {
        logs.push_back(log_error(cell));
        out[next++] = (table.name == "3.13" ? 50 : 1) * logs.back();
      }
      if (has_trends(table))
        for (const auto& [low, high] : trends(table)) out[next++] = against_trend(table, logs, low, high);
    }
    return std::ranges::all_of(out, [](double r) { return std::isfinite(r); }) ? Solved::yes : Solved::no;
  }

  std::vector<std::pair<std::string, double>> summary(const Model& model,
                                                      const Fidelity& fidelity) const override {
    std::vector<std::pair<std::string, double>> out;
    for (const auto& comparison : experiments_.simulate(model, fidelity.simulation))
      for (const auto& [quantity, error] : comparison.rms_log_error)
        out.emplace_back("table " + comparison.table.name + ", " + quantity, error);
    return out;
  }

 private:
  static bool has_trends(const recordings::PublishedTable& table) {
    return table.cells.front().quantity.starts_with("displacement_change") &&
           std::ranges::any_of(table.cells.front().keys,
                               [](const auto& key) { return key.first == "prestress_MPa"; });
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

  PublishedExperiments experiments_;
};

}  // namespace

std::unique_ptr<ResidualModel> table_residuals(const std::vector<std::string>& tables,
                                               const std::map<std::string, double>& parameters) {
  return std::make_unique<TableResiduals>(tables, parameters);
}

recordings::Comparison simulate_table(const Model& model, const std::string& table,
                                      const SimulationOptions& options,
                                      const std::map<std::string, double>& parameters) {
  return PublishedExperiments({table}, parameters).simulate(model, options).front();
}

}  // namespace ferrobench::model

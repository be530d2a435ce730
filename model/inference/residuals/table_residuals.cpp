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
      const auto count = table.cells.size() + trends(table).size();
      parts_.push_back({"table " + table.name, size_, count, true});
      size_ += count;
    }
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
  Solved fill(const Model& model, const Fidelity& fidelity, const std::vector<FreeParameter>& by,
              std::span<double> out, Eigen::MatrixXd* slopes) const override {
    auto bounded = fidelity.simulation;
    if (bounded.most_steps == 0)
      bounded.most_steps = fidelity.coarse ? most_steps_of_a_run : 50 * most_steps_of_a_run;
    try {
      if (slopes == nullptr) {
        put(experiments_.simulate(model, bounded), out);
      } else {
        std::vector<std::string> paths;
        paths.reserve(by.size());
        for (const auto& p : by) paths.push_back(p.path);
        const auto around = experiments_.simulate_around(model, paths, bounded);
        put(around.here, out);
        std::vector<double> below(size_), above(size_);
        for (std::size_t p = 0; p < paths.size(); ++p) {
          if (!(around.by[p].apart > 0)) continue;
          put(around.by[p].below, below);
          put(around.by[p].above, above);
          for (std::size_t i = 0; i < size_; ++i)
            (*slopes)(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(p)) =
                (above[i] - below[i]) / around.by[p].apart;
        }
      }
    } catch (const Error& e) {
      if (e.code() == ErrorCode::numerical || e.code() == ErrorCode::bad_model) return Solved::no;
      throw;
    }
    return Solved::yes;
  }

  static void put(const std::vector<recordings::Comparison>& comparisons, std::span<double> out) {
    std::size_t next = 0;
    for (const auto& [table, cells, scale, error] : comparisons) {
      std::vector<double> logs;
      for (const auto& cell : cells) {
        logs.push_back(log_error(cell));
        out[next++] = weighted_error(cell);
      }
      for (const auto& [low, high] : trends(table)) out[next++] = against_trend(table, logs, low, high);
    }
  }

  // Pairs of cells that follow each other along the trend's key and are alike in all other keys.
  static std::vector<std::pair<std::size_t, std::size_t>> trends(const recordings::PublishedTable& table) {
    const auto& trend = table.description.trend;
    std::vector<std::pair<std::size_t, std::size_t>> out;
    if (!trend) return out;
    const auto others = [&trend](const recordings::PublishedCell& cell) {
      auto keys = cell.keys;
      std::erase_if(keys, [&trend](const auto& key) { return key.first == trend->along; });
      return keys;
    };
    for (std::size_t i = 0; i < table.cells.size(); ++i) {
      const auto& a = table.cells[i];
      if (a.quantity != table.description.quantities.front().column || a.key(trend->where_negative) >= 0)
        continue;
      std::optional<std::size_t> next;
      for (std::size_t j = 0; j < table.cells.size(); ++j) {
        const auto& b = table.cells[j];
        if (a.quantity != b.quantity || others(a) != others(b) || b.key(trend->along) <= a.key(trend->along))
          continue;
        if (!next || b.key(trend->along) < table.cells[*next].key(trend->along)) next = j;
      }
      if (next) out.emplace_back(i, *next);
    }
    return out;
  }

  // Zero if the cells differ the published way by as much as the trend says, or more.
  static double against_trend(const recordings::PublishedTable& table, const std::vector<double>& logs,
                              std::size_t low, std::size_t high) {
    const auto& trend = *table.description.trend;
    const double published = std::log(table.cells[high].published / table.cells[low].published);
    const double simulated = published + logs[high] - logs[low];
    return std::max(0.0, trend.least - (published < 0 ? -simulated : simulated)) / trend.uncertainty;
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

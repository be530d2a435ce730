#include "model/inference/residuals/whitened_tables.h"

#include <fmt/format.h>

#include <algorithm>

namespace ferrobench::model::inference {
namespace {

constexpr double shortest_of_interest = 0.01;  // s; creep over seconds does not show less

// "prestress_MPa" 8: "8 MPa"
std::string with_unit(const recordings::PublishedTable& table, const std::pair<std::string, double>& of) {
  const auto key = std::ranges::find(table.description.keys, of.first, &recordings::TableKey::column);
  return key->unit.empty() ? fmt::format("{} {:g}", of.first, of.second)
                           : fmt::format("{:g} {}", of.second, key->unit);
}

// Of all cells, in the order of cells_of().
std::vector<double> errors_of(const std::vector<recordings::Comparison>& comparisons) {
  std::vector<double> out;
  for (const auto& comparison : comparisons)
    for (const auto& cell : comparison.cells) out.push_back(weighted_error(cell));
  return out;
}

}  // namespace

std::vector<TableCell> cells_of(const PublishedExperiments& experiments) {
  std::vector<TableCell> out;
  for (const auto& table : experiments.tables())
    for (const auto& cell : table.cells) {
      TableCell c;
      c.table = table.name;
      c.published = cell;
      c.std = cell.uncertainty;
      c.run = with_unit(table, cell.keys.front());
      if (cell.keys.size() > 1) c.detail = with_unit(table, cell.keys[1]);
      if (table.quantity_of(cell).channel == recordings::MeasuredChannel::charge)
        c.channel = recordings::Channel::charge;
      out.push_back(std::move(c));
    }
  return out;
}

WhitenedTableCells::WhitenedTableCells(const PublishedExperiments& experiments,
                                       std::vector<std::size_t> chosen, SimulationOptions simulation,
                                       int threads)
    : WhitenedResiduals(simulation, threads), experiments_(experiments), chosen_(std::move(chosen)) {
  size_ = static_cast<Eigen::Index>(chosen_.size());
  samples_ = static_cast<double>(size_);
}

std::optional<Eigen::MatrixXd> WhitenedTableCells::slopes(const Hypothesis& hypothesis,
                                                          const Eigen::VectorXd& z,
                                                          Eigen::Index first) const {
  Eigen::MatrixXd out = Eigen::MatrixXd::Zero(size(), z.size() - first);
  std::vector<std::string> paths;
  std::vector<Eigen::Index> column_of;
  for (auto i = first; i < z.size(); ++i) {
    const auto& c = hypothesis.parameters[static_cast<std::size_t>(i)];
    if (!c.of_model()) continue;
    paths.push_back(c.path);
    column_of.push_back(i);
  }
  auto options = simulation();
  options.most_steps = most_steps_of_a_run;
  try {
    const auto around = experiments_.simulate_around(setting_at(hypothesis, z).model, paths, options);
    for (std::size_t p = 0; p < paths.size(); ++p) {
      if (!(around.by[p].apart > 0)) continue;
      const auto below = errors_of(around.by[p].below), above = errors_of(around.by[p].above);
      const auto column = column_of[p];
      const double by = hypothesis.parameters[static_cast<std::size_t>(column)].slope(z[column]);
      for (std::size_t i = 0; i < chosen_.size(); ++i)
        out(static_cast<Eigen::Index>(i), column - first) =
            -by * (above[chosen_[i]] - below[chosen_[i]]) / around.by[p].apart;
    }
  } catch (const Error& e) {
    if (e.code() == ErrorCode::cancelled) throw;
    return std::nullopt;
  }
  if (!out.allFinite()) return std::nullopt;
  return out;
}

WhitenedResiduals::Times WhitenedTableCells::times() const {
  return {.shortest = shortest_of_interest, .longest = experiments_.duration()};
}

void WhitenedTableCells::fill(std::span<const Wanted> alike, std::size_t) const {
  auto options = simulation();
  options.most_steps = most_steps_of_a_run;
  for (const auto& wanted : alike) {
    std::vector<double> errors;
    try {
      errors = errors_of(experiments_.simulate(wanted.setting.model, options));
    } catch (const Error& e) {
      if (e.code() == ErrorCode::cancelled) throw;
    }
    for (std::size_t i = 0; i < chosen_.size(); ++i)
      (*wanted.residual)[static_cast<Eigen::Index>(i)] = errors.empty() ? unsolvable : -errors[chosen_[i]];
  }
}

}  // namespace ferrobench::model::inference

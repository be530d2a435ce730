#include "model/inference/residuals/whitened_tables.h"

#include <fmt/format.h>

namespace ferrobench::model::inference {
namespace {

constexpr double stroke_known_to = 0.005, creep_known_to = 0.2;
constexpr double shortest_of_interest = 0.01;  // s; creep over seconds does not show less

// "prestress_MPa" 8: "8 MPa"
std::string with_unit(const std::pair<std::string, double>& key) {
  if (key.first == "prestress_MPa") return fmt::format("{:g} MPa", key.second);
  if (key.first == "rate_V_per_s") return fmt::format("{:g} V/s", key.second);
  if (key.first == "field_kV_per_mm") return fmt::format("{:g} kV/mm", key.second);
  return fmt::format("{} {:g}", key.first, key.second);
}

}  // namespace

std::vector<TableCell> cells_of(const PublishedExperiments& experiments) {
  std::vector<TableCell> out;
  for (const auto& table : experiments.tables())
    for (const auto& cell : table.cells) {
      TableCell c;
      c.table = table.name;
      c.published = cell;
      const bool stroke = cell.quantity.find("stroke") != std::string::npos;
      c.std = (stroke ? stroke_known_to : creep_known_to) * (cell.doubtful ? 2 : 1);
      c.run = with_unit(cell.keys.front());
      if (cell.keys.size() > 1) c.detail = with_unit(cell.keys[1]);
      if (cell.quantity.starts_with("polarization")) c.channel = recordings::Channel::charge;
      out.push_back(std::move(c));
    }
  return out;
}

WhitenedTableCells::WhitenedTableCells(const PublishedExperiments& experiments,
                                       std::vector<std::size_t> chosen, SimulationOptions simulation,
                                       int threads)
    : WhitenedResiduals(simulation, threads),
      experiments_(experiments),
      cells_(cells_of(experiments)),
      chosen_(std::move(chosen)) {
  size_ = static_cast<Eigen::Index>(chosen_.size());
}

WhitenedResiduals::Times WhitenedTableCells::times() const {
  return {.shortest = shortest_of_interest, .longest = experiments_.duration()};
}

void WhitenedTableCells::fill(std::span<const Wanted> alike, std::size_t) const {
  std::vector<double> errors;
  auto options = simulation();
  options.most_steps = most_steps_of_a_run;
  // A table's cells have no gains: those alike are the same.
  try {
    for (const auto& comparison : experiments_.simulate(alike.front().setting.model, options))
      for (const auto& cell : comparison.cells) errors.push_back(log_error(cell));
  } catch (const Error& e) {
    if (e.code() == ErrorCode::cancelled) throw;
  }
  for (const auto& wanted : alike)
    for (std::size_t i = 0; i < chosen_.size(); ++i)
      (*wanted.residual)[static_cast<Eigen::Index>(i)] =
          errors.empty() ? unsolvable : -errors[chosen_[i]] / cells_[chosen_[i]].std;
}

}  // namespace ferrobench::model::inference

// Residuals on the cells of published tables:
//
//   ln(published / simulated) / std
//
// std is how well a cell is known, as the table's description says (recordings/tables).
#pragma once

#include "model/fit/published.h"
#include "model/inference/residuals/whitened_residuals.h"

namespace ferrobench::model::inference {

struct TableCell {
  std::string table;
  recordings::PublishedCell published;
  double std = 0;      // of the logarithm
  std::string run;     // "8 MPa", "50 V/s": what recordings are for a bench
  std::string detail;  // "-0.45 kV/mm", or ""
  recordings::Channel channel = recordings::Channel::displacement;
};
// Of all tables, in the order of PublishedExperiments::simulate().
std::vector<TableCell> cells_of(const PublishedExperiments& experiments);

class WhitenedTableCells final : public WhitenedResiduals {
 public:
  // Of the cells chosen. `experiments` must outlive it.
  WhitenedTableCells(const PublishedExperiments& experiments, std::vector<std::size_t> chosen,
                     SimulationOptions simulation, int threads);
  std::optional<Eigen::MatrixXd> slopes(const Hypothesis& hypothesis, const Eigen::VectorXd& z,
                                        Eigen::Index first = 0) const override;
  Times times() const override;
  std::vector<double> tones(const Eigen::VectorXd&, const EffectParameter&, std::size_t) const override {
    return {};
  }
  std::vector<double> limits(const EffectParameter&) const override { return {}; }

 private:
  std::vector<std::size_t> parts() const override { return {0}; }
  void fill(std::span<const Wanted> alike, std::size_t part) const override;

  const PublishedExperiments& experiments_;
  std::vector<std::size_t> chosen_;
};

}  // namespace ferrobench::model::inference

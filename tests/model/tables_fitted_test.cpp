// The published tables as a fit sees them, and how near the shipped models come.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "model/fit/published.h"
#include "model/inference/residuals/residual_model.h"
#include "recordings/tables/published.h"

namespace ferrobench::model {
namespace {

Model specimen_of(const std::string& table) {
  return library_model(recordings::published_table(table).description.specimen);
}

// Root mean squares of ln(measured / published) over the cells whose print is not doubtful.
std::map<std::string, double> rms_where_print_is_clear(
    const std::vector<recordings::Comparison>& comparisons) {
  std::map<std::string, double> out;
  for (const auto& comparison : comparisons) {
    std::map<std::string, std::pair<double, int>> sums;
    for (const auto& cell : comparison.cells) {
      if (cell.published.doubtful) continue;
      auto& [squares, count] = sums[cell.published.quantity];
      squares += std::pow(std::log(cell.measured.value() / cell.published.published), 2);
      ++count;
    }
    for (const auto& [quantity, sum] : sums)
      out[comparison.table.name + " " + quantity] = std::sqrt(sum.first / sum.second);
  }
  return out;
}

// The bench, which sees the corners through noise and converters, reads up to 0.05 % less of the fast strokes
// and is within 0.1 %.
TEST(ShippedModels, GiveTheStrokesOfTheStage) {
  for (const auto& cell : simulate_table(specimen_of("3.13"), "3.13", below_noise).cells)
    EXPECT_NEAR(cell.measured.value() / cell.published.published, 1, 1.3e-3);
}

// One set of parameters for all three.
TEST(ShippedModels, ComeNearTheCreepOfTheStack) {
  const PublishedExperiments experiments({"3.10", "3.11", "3.12"});
  const auto rms = rms_where_print_is_clear(experiments.simulate(specimen_of("3.11"), below_noise));
  EXPECT_LT(rms.at("3.11 displacement_change_um"), 0.09);
  EXPECT_LT(rms.at("3.12 polarization_change_C_per_m2"), 0.09);
  EXPECT_LT(rms.at("3.10 displacement_range_um"), 0.35);
  EXPECT_LT(rms.at("3.10 polarization_range"), 0.265);
}

// Of a fast ramp the strain's extreme lies after the corner, where the fewest samples used to be.
TEST(TableExperiments, ReadStrokesAsDenselySampledRunsDo) {
  constexpr SimulationOptions options{.tolerance = 1e-4, .domains = 1000};
  const auto model = specimen_of("3.13");
  const auto cells = simulate_table(model, "3.13", options).cells;
  for (const auto& cell : cells) {
    const double ramp = 150 / cell.published.key("rate_V_per_s");
    const std::vector<double> knots{0, ramp, 2 * ramp, 3 * ramp, 4 * ramp}, field{0, 1.5e6, 0, 1.5e6, 0};
    std::vector<double> times(20001), x(times.size());
    for (std::size_t i = 0; i < times.size(); ++i)
      times[i] = knots.back() * static_cast<double>(i) / static_cast<double>(times.size() - 1);
    ChannelSpans out;
    out.displacement = x;
    simulate_at(model, knots, field, times, out, options);
    const auto [low, high] = std::ranges::minmax(x);
    EXPECT_NEAR(cell.measured.value() * 1e-6, high - low, 3e-4 * (high - low));
  }
}

// Slopes are those of central differences, which need enough domains not to see the steps of their sum.
TEST(TableResiduals, HaveExactSlopes) {
  constexpr SimulationOptions options{.tolerance = 1e-5, .domains = 1000};
  const Fidelity fidelity{.simulation = options};
  const auto model = specimen_of("3.11");
  const auto target = table_residuals({"3.11", "3.12"});
  std::vector<FreeParameter> by;
  for (const auto* path :
       {"effects.dielectric_leakage.resistivity", "effects.logarithmic_creep.fraction_per_decade"})
    by.push_back(free_parameter(model, path));
  std::vector<double> here(target->size()), plain(target->size());
  Eigen::MatrixXd slopes;
  ASSERT_EQ(target->evaluate_with_slopes(model, fidelity, by, here, slopes), Solved::yes);
  ASSERT_EQ(target->evaluate(model, fidelity, plain), Solved::yes);
  EXPECT_EQ(here, plain);
  for (std::size_t p = 0; p < by.size(); ++p) {
    const double value = get_parameter(model, by[p].path), step = 1e-2 * value;
    std::vector<double> below(here.size()), above(here.size());
    target->evaluate(with_parameters(model, {{by[p].path, value - step}}), fidelity, below);
    target->evaluate(with_parameters(model, {{by[p].path, value + step}}), fidelity, above);
    double squares = 0, missed = 0;
    for (std::size_t i = 0; i < here.size(); ++i) {
      const double difference = (above[i] - below[i]) / (2 * step);
      squares += difference * difference;
      missed += std::pow(difference - slopes(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(p)), 2);
    }
    EXPECT_GT(squares, 0);
    EXPECT_LT(missed, 1e-3 * squares) << by[p].path;
  }
}

}  // namespace
}  // namespace ferrobench::model

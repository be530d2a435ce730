// Fitting a model's parameters: nonlinear least squares over what a target asks for, within physical ranges,
// from several starts.
//
// A parameter moves on a logistic scale between its bounds, so the search is unconstrained and never leaves
// them. The first start is the model given; the others are drawn around the best so far, from the seed.
// Derivatives are central differences; a fixed set of domains and a fixed tolerance keep them smooth.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "model/fit/parameters.h"
#include "model/model.h"
#include "model/simulator.h"
#include "recordings/recording.h"
#include "recordings/tables/comparison.h"

namespace ferrobench::model {

// What a model should come near to.
class FitTarget {
 public:
  virtual ~FitTarget() = default;
  virtual std::size_t size() const = 0;
  // Residuals of the model, each about 1 where it is as bad as a plain guess.
  virtual void residuals(const Model& model, const SimulationOptions& options,
                         std::span<double> out) const = 0;
  // Names with the root mean square of their part of the residuals: "displacement_change_um" 0.2, ...
  virtual std::vector<std::pair<std::string, double>> summary(const Model& model,
                                                              const SimulationOptions& options) const = 0;
  // What was given and says nothing, a sentence each: "loops, force never changes".
  virtual std::vector<std::string> unused() const { return {}; }
};

// Published tables, fitted together: the logarithm of each cell's ratio, and that the displacement's creep
// changes with the prestress in the direction that was published. `parameters` override those of the
// protocols (for example rate).
std::unique_ptr<FitTarget> table_target(const std::vector<std::string>& tables,
                                        const std::map<std::string, double>& parameters = {});
// The comparison that the target makes, for a look at the cells.
recordings::Comparison simulate_table(const Model& model, const std::string& table,
                                      const SimulationOptions& options,
                                      const std::map<std::string, double>& parameters = {});

// Recordings: charge, displacement and force against the simulated, over each channel's range, where they
// were measured. Each is simulated with its own load and specimen, under its command (its field if there is
// none).
std::unique_ptr<FitTarget> recording_target(std::vector<recordings::Recording> recordings);

struct FitProgress {
  int start = 0, starts = 0;
  double fraction = 0;  // of the whole, 0 to 1
  double cost = 0;      // best sum of squares so far
};

struct FitOptions {
  std::vector<FreeParameter> free;
  int starts = 4;
  int iterations = 30;  // of each start, at most
  double spread = 0.4;  // of the drawn starts, on the logistic scale
  std::uint64_t seed = 1;
  // As everywhere else, so that what is fitted is what will be simulated. Its `stop` ends the fit in the
  // middle of a simulation, with the best found before.
  SimulationOptions simulation;
  // Called between simulations; false ends the fit with the best found.
  std::function<bool(const FitProgress&)> progress;
};

struct FittedParameter {
  FreeParameter free;
  double from = 0, to = 0;
  double std = 0;         // of the logistic scale turned back, one standard deviation; 0 if not determined
  bool at_bound = false;  // within 1 % of its range's end
};

struct FitResult {
  Model model;
  std::vector<FittedParameter> parameters;
  double cost_before = 0, cost_after = 0;  // sums of squared residuals
  int simulations = 0;
  bool stopped = false;  // by progress() or stop()
};

FitResult fit(const Model& start, const FitTarget& target, const FitOptions& options);

// Parameters that a fit frees if nothing is said: material and polycrystal without what cannot be told
// (temperature), and the parameters of the model's effects.
std::vector<FreeParameter> default_free_parameters(const Model& model);

}  // namespace ferrobench::model

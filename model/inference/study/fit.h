// Fitting a model's parameters to recordings or to published tables, from nothing if need be:
//
//   1. starts: the model given, what the loops themselves show (search/features.h), and global searches
//      (search/global_search.h) of the whole range by a coarse simulation; where parameters enter linearly
//      they are eliminated (residuals/separable.h)
//   2. from the best of these nonlinear least squares (solver/least_squares.h), by a better simulation
//   3. from the best of those by the simulation that is used everywhere
//   4. uncertainty from the slopes there (solver/covariance.h)
//
// A recording that does not say what its specimen had been through is given the likeliest past
// (search/pasts.h): for the starts under the model given and what the loops show, then again under the best
// that was found, until the pasts stay as they are. Pasts of tables that are met badly are doubted then, with
// numbers that are fitted beside other ones. Their uncertainty is none of the parameters'.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "model/inference/parameters/parameters.h"
#include "model/inference/residuals/residual_model.h"
#include "model/inference/search/pasts.h"

namespace ferrobench::model {

struct FitProgress {
  std::string stage;    // "searching", ...
  double fraction = 0;  // of the whole, 0 to 1
  double cost = 0;      // best sum of squares so far
};

// How finely is simulated where a fit is not yet near its end, under a simplified drive.
struct SimulationFidelity {
  int domains = 0;
  double tolerance = 0;
};

struct FitOptions {
  std::vector<FreeParameter> free;
  // 1: least squares from the model given alone. More: global searches, one less than this, and what the data
  // show.
  int starts = 6;
  int refined = 2;      // searches that go on after half of their way (search/global_start.h)
  int iterations = 30;  // of each least-squares solution, at most
  std::uint64_t seed = 1;
  // On the loops of a ceramic, which the model misses by 5 to 10 % of the range in each channel, root of the
  // sum of squares over six channels: 1.4 % off at a twentieth of the cost, and 0.05 % off at less than half.
  SimulationFidelity coarse{128, 1e-3}, middle{1000, 1e-4};
  // As everywhere else, so that what is fitted is what will be simulated. Its `stop` ends the fit in the
  // middle of a simulation, with the best found before.
  SimulationOptions simulation;
  // Called between simulations, by one thread at a time; false ends the fit with the best found.
  std::function<bool(const FitProgress&)> progress;
};

struct FittedParameter {
  FreeParameter free;
  double from = 0, to = 0;
  double std = 0;            // one standard deviation
  double low = 0, high = 0;  // 95 % interval, within the range
  bool at_bound = false;     // within 1 % of its range's end
  // Not at a bound, and its interval is no more than half of its range, in the logarithm where that is the
  // scale.
  bool determined = false;
};

struct FitResult {
  Model model;
  std::vector<FittedPast> pasts;  // of the recordings
  // The residuals under these pasts where any was chosen; null: those given.
  std::shared_ptr<const ResidualModel> residuals;
  std::vector<FittedParameter> parameters;
  // Coefficients between the parameters' errors, by row and column as in `parameters`.
  std::vector<std::vector<double>> correlations;
  double cost_before = 0, cost_after = 0;  // sums of squared residuals
  int simulations = 0;
  bool stopped = false;  // by progress() or stop(); then there is no uncertainty
};

FitResult fit(const Model& start, const ResidualModel& residuals, const FitOptions& options);

}  // namespace ferrobench::model

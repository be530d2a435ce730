// Fitting a model's parameters to recordings or to published tables, from nothing if need be:
//
//   1. global searches of the whole range (search/global_search.h), by a coarse simulation; where parameters
//   enter
//      linearly they are eliminated (residuals/separable.h)
//   2. from each search's minimum, and from the model given, nonlinear least squares
//   (solver/least_squares.h), coarse
//   3. from the best of these, nonlinear least squares by the simulation that is used everywhere
//   4. uncertainty from the slopes there
//
// Intervals are those of a model that is not exactly true: with A = J^T J / s^2 + 12 I and the residuals of
// one part of the recording counted as correlated over t_p of its rows (their integrated autocorrelation),
// the covariance is A^-1 (sum over parts of t_p s_p^2 / s^4 J_p^T J_p + 12 I) A^-1 (P. J. Huber 1967, H.
// White 1982). The term 12 I is the information in a uniform distribution over the parameter's range: what
// the data do not determine stays within it.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "model/inference/parameters/parameters.h"
#include "model/inference/residuals/residual_model.h"

namespace ferrobench::model {

struct FitProgress {
  std::string stage;    // "searching", ...
  double fraction = 0;  // of the whole, 0 to 1
  double cost = 0;      // best sum of squares so far
};

struct FitOptions {
  std::vector<FreeParameter> free;
  int starts = 4;       // the first from the model given, each of the others from a global search
  int iterations = 30;  // of each least-squares solution, at most
  std::uint64_t seed = 1;
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
  std::vector<FittedParameter> parameters;
  // Coefficients between the parameters' errors, by row and column as in `parameters`.
  std::vector<std::vector<double>> correlations;
  double cost_before = 0, cost_after = 0;  // sums of squared residuals
  int simulations = 0;
  bool stopped = false;  // by progress() or stop(); then there is no uncertainty
};

FitResult fit(const Model& start, const ResidualModel& residuals, const FitOptions& options);

}  // namespace ferrobench::model

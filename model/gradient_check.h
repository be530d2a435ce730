// Compares forward sensitivities with central differences, for all that bring in a parameter or an effect.
//
// A difference of two plain simulations shows mostly what their step sizes and tolerances do. So the run is
// recorded as a step plan (step_plan.h), and the slopes and all differences are made of runs that follow it,
// with the coupling of loads and fractions solved tightly. What is compared is then a smooth function of the
// parameters but for kinks. The differences are of fourth order,
//
//     f' = (8 (f(p + d) - f(p - d)) - (f(p + 2 d) - f(p - 2 d))) / 12 d + O(d^4)
#pragma once

#include <span>
#include <string>
#include <vector>

#include "model/simulator.h"

namespace ferrobench::model {

struct GradientCheckOptions {
  SimulationOptions simulation;
  // d as shares of the parameter's magnitude, tried in turn until all channels agree to `enough`: small
  // enough for O(d^4) and for kinks in the values not to lie within, large enough for what rounding makes of
  // the differences.
  std::vector<double> relative_steps{1e-5, 1e-4, 1e-6, 1e-3, 1e-7, 1e-2};
  double enough = 1e-6;
};

struct CheckedParameter {
  std::string path;
  double scale = 0;  // stands for the parameter's magnitude; 0: that of its value
};

// Of one parameter and one channel.
struct SlopeCheck {
  std::string parameter;
  std::string_view channel;
  double largest = 0;  // |slope| times the parameter's magnitude, as a share of the channel's range
  // Difference from the central one, rms over time, as a share of the slope's own rms; the least over the
  // steps d.
  double error = 0;
};

// Of all parameters and channels, where the channel moves at all.
std::vector<SlopeCheck> check_gradient(const Model& model, std::span<const CheckedParameter> parameters,
                                       std::span<const double> knot_time, std::span<const double> knot_field,
                                       std::span<const double> times,
                                       const GradientCheckOptions& options = {});

}  // namespace ferrobench::model

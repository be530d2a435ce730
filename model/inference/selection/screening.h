// The score test of every effect: which could explain what a fit leaves, without refitting? Each is simulated
// at a few shapes, its amplitude is found on the way, and what the fit's own parameters could take up of its
// response is projected out (solver/projection.h).
#pragma once

#include <functional>
#include <span>
#include <vector>

#include "model/effects/catalogue.h"
#include "model/inference/solver/gauss_newton.h"

namespace ferrobench::model::inference {

// An effect at values of its parameters.
struct EffectStart {
  const Effect* effect = nullptr;
  std::vector<double> values;
};

// How each of these, added where the fit stands, changes the whitened residual. Those that differ in sensors
// only share a simulation. Many are asked for by and by: each answer is as long as the recordings.
inline constexpr std::size_t responses_at_a_time = 16;
std::vector<Eigen::VectorXd> responses(const WhitenedResiduals& residuals, const Fit& fit,
                                       std::span<const EffectStart> effects);

struct Screened {
  const Effect* effect = nullptr;
  std::vector<double> values;  // of its parameters, where it explains most
  double drop = 0;             // of the sum of squares
  Eigen::VectorXd response;    // change of the whitened residual at `values`
  // The largest response at a plausible size, as a sum of squares that no parameter can take up.
  double excited = 0;
  double strength = 0, across = 0;  // Amplitude::strength where the response was last seen, and its square
};

struct ScreenOptions {
  std::span<const Effect* const> effects;
  int rounds = 5;
  // An earlier screen, on the same recordings: amplitudes start where the response was a plausible one.
  std::span<const Screened> before{};
  std::function<void(double)> tick;  // with the share done; may throw
};

// Best first. `fit` must have a fresh Jacobian.
std::vector<Screened> screen(const WhitenedResiduals& residuals, const Fit& fit,
                             const ScreenOptions& options);

}  // namespace ferrobench::model::inference

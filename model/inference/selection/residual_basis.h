// What a fit leaves, regressed on plain functions of the signals, one set for each family of effects and put
// where that family acts: no mechanism is claimed, but what remains is seen, and where it enters.
//
//   drive                 field:          the field, its lags, its square and cube
//   charge sensor         charge:         time, the charge's lags, integral and square
//   polarization          charge:         field and |field| to the third, their lags
//   displacement sensor   displacement:   time, the displacement's lags and powers, the field
//   force sensor          force:          time, the force's lags and powers, the field
//   strain                displacement and, through the spring, force: field and stress to the third, lags
//   equilibrium           displacement and force against each other: powers, friction, time
//   kinetics              charge, displacement and force in the proportions of switching domains: the
//                         fractions' lags and rates
#pragma once

#include <optional>
#include <vector>

#include "model/inference/residuals/whitened_recordings.h"
#include "model/inference/selection/explanation.h"
#include "model/inference/solver/gauss_newton.h"

namespace ferrobench::model::inference {

struct BasisFit {
  Family family = Family::kinetics;
  double drop = 0;  // of the sum of squares
  int functions = 0;
  double beyond_chance = 0;     // drop less what so many functions take of noise
  std::vector<double> weights;  // of the family's functions
};

// The family whose functions explain most beyond chance, of all or of those that act on one channel. `fit`
// must have a Jacobian.
BasisFit fit_residual_basis(const WhitenedRecordings& residuals, const Fit& fit,
                            std::optional<recordings::Channel> acted_on = {});

// What the functions so weighted add to each channel where the family acts, by recording; worst first in
// units of the noise, one for each channel.
std::vector<MissingSignal> reconstruct_signals(const WhitenedRecordings& residuals, const Fit& fit,
                                               const BasisFit& explained);

}  // namespace ferrobench::model::inference

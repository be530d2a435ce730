// How far a fit may be believed: what it leaves of the measurement in units of the noise, and how many
// parameters ended at a bound of their range. Noise counts as no less than simulations resolve
// (observation/noise.h). A parameter at its bound holds the others where they are, so that no interval says
// where the truth is.
#pragma once

#include <array>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "model/inference/study/fit.h"

namespace ferrobench::model {

// Standard deviation by Channel, SI: as the recording states it, else estimated from its samples.
using NoiseByChannel = std::array<double, recordings::all_channels.size()>;
NoiseByChannel noise_of(const recordings::Recording& recording);

struct FitVerdict {
  std::optional<double> times_noise;  // the largest of all channels; none where tables were fitted to
  std::string where;                  // that channel: "loops, displacement"
  int at_bound = 0, parameters = 0;

  bool intervals_hold() const { return at_bound == 0; }
  std::string text() const;  // one or two sentences
};

// `after`: ResidualModel::summary() of the fitted model; `noise`: of the recordings, in their order.
FitVerdict judge(const FitResult& result, const ResidualModel& residuals,
                 std::span<const std::pair<std::string, double>> after,
                 std::span<const NoiseByChannel> noise);

}  // namespace ferrobench::model

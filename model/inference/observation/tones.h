// Sinusoids that stand out of residuals: a periodogram by least squares for samples at any times (N. R. Lomb,
// Astrophys. Space Sci. 39 (1976) 447), of sines with phase zero at each start.
#pragma once

#include <Eigen/Dense>
#include <cstddef>
#include <utility>
#include <vector>

#include "model/simulator.h"

namespace ferrobench::model::inference {

// Residuals of one recording.
struct ToneSeries {
  double duration = 0;       // of the recording, s
  std::vector<double> time;  // s from the recording's start
  Eigen::VectorXd value;     // at those times, in standard deviations
};

// The frequencies within `range` [Hz] that take most off the sum of squares of all series together, at most
// `count`, the strongest first. Throws Error(cancelled) if `simulation.stop` says so.
std::vector<double> strongest_tones(const std::vector<ToneSeries>& series, std::pair<double, double> range,
                                    std::size_t count, int threads, const SimulationOptions& simulation);

}  // namespace ferrobench::model::inference

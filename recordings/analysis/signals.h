// The channels as the reports measure them: polarization from charge, and values freed of noise.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "recordings/analysis/cycles.h"
#include "recordings/analysis/local_fit.h"
#include "recordings/analysis/uncertainty.h"
#include "recordings/format/recording.h"

namespace ferrobench::recordings {

// One channel, with the standard deviation of its noise: the recording's own figure, or an estimate from the
// samples.
struct Signal {
  std::span<const double> values;  // of the recording, which outlives this, of `own` or of `fits`
  std::shared_ptr<std::vector<double>> own = {};
  double noise = 0;
  // Noise so small that single samples can be trusted (below a millionth of the range).
  bool exact = true;
  // What the samples themselves say of their noise: level and colour from quiet windows; where there are
  // too few of these, white with the level above and a converter's rounding.
  Noise statistics = {};
  double lsb = 0;               // of the converter, in the signal's unit; 0 if not known
  double gain_uncertainty = 0;  // relative, standard: as the device's description states it, or 0

  // Where `values` are smoothed: the samples, and what was made of them.
  std::span<const double> measured = {};
  std::shared_ptr<Smoothed> fits = {};

  // values[at] with the samples that make it.
  Reading reading(std::size_t at) const;
  // The same where the signal is largest or smallest.
  Reading extreme(std::size_t at) const;
  // What such readings have been made into, with its uncertainty.
  Estimate estimate(const Reading& reading) const;
};

Signal signal(const Recording& recording, Channel channel);
// P = Q / (n A) [C/m^2], electrodes in parallel. Relative to the first sample if the charge is.
Signal polarization(const Recording& recording);
// The field measured, or the one commanded where it was not.
const std::vector<double>& field_of(const Recording& recording);

// As smooth() of local_fit.h does it. An exact signal comes back as it is.
Signal smoothed(Signal signal, const std::vector<Turn>& turns);

// Value at sample `at`, one end of a stretch of `count` samples that begins at `first`: the sample itself if
// the signal is exact, else a line through as many samples next to it as bring the noise to 1 % of the
// stretch's change and the curve allows (local_fit.h), a hundredth of the stretch (5 samples at least) at the
// most.
Reading edge_reading(const Recording& recording, const Signal& signal, std::size_t first, std::size_t count,
                     bool at_end);

}  // namespace ferrobench::recordings

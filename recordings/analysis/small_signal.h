// The small-signal response against bias: a lock-in in software on the sines of small_signal segments
// (protocols/segments.h).
//
// At each bias, over all cycles of the sine but the first, in which what lags has yet to follow, each channel
// is fitted by linear least squares (the sine fit of known frequency of IEEE Std 1057-2017),
//
//   y(t) = sum over j = 0..3 of p_j (t - t_m)^j + sum over k = 1..3 of a_k cos(k w t) + b_k sin(k w t),
//
// t from the start of the sine, t_m in the middle of the samples, w from the cycles and the time that they
// took. The p_j are the offset and the creep at the bias, whose curvature would else count as noise where
// domains switch; the harmonics keep the curvature of the response out of the fundamental. A channel's phasor
// is Y = a_1 - i b_1, so that its fundamental is Re(Y exp(i w t)).
// Phases count from the field as it was measured (as it was commanded, where it was not measured): what the
// amplifier does is in no figure, a resistance R between its monitor and the specimen is, w R C in tan delta.
// With the phasors E [V/m], Q [C], x [m] and the recording's own specimen, n layers of thickness d and area
// A, active length L:
//
//   Q / (E d) = C (1 - i tan delta)      C [F]; tan delta > 0 where the charge lags, by which energy is lost
//   eps_r = C d / (eps_0 n A)
//   x / (E L) = d33 exp(i phase)         d33 [m/V], strain over field: displacement over voltage as for one
//                                        layer; phase < 0 where the displacement lags, near 180 degrees
//                                        where it goes against the field
//
// x is the displacement at the load of the recording, not of a free specimen, unless it was free.
//
// Uncertainties (uncertainty.h): z = Y / E moves with the samples by dz = (dY - z dE) / E, and a figure f(z)
// by the real part of f' dz. Noise is what a fit leaves, its deviation at this bias, its colour
// (noise_colour.h) from all biases together. C, eps_r and d33 have the calibration of both channels, their
// ratios none. Where |z| is below five of its standard uncertainties, no figure is linear in the noise: none
// has an uncertainty then, and there is no phase and no tan delta.
#pragma once

#include <optional>
#include <vector>

#include "recordings/analysis/bias_sines.h"
#include "recordings/analysis/uncertainty.h"
#include "recordings/format/recording.h"

namespace ferrobench::recordings {

struct SmallSignalPoint {
  BiasSine sine;
  double frequency = 0;                                          // Hz
  double amplitude = 0;                                          // V/m, of the field
  std::optional<Estimate> capacitance, permittivity, tan_delta;  // F, 1, 1; with a charge
  std::optional<Estimate> d33, phase;  // m/V, degrees in [-90, 270); with a displacement
};
// In the order of time. None where neither charge nor displacement was measured; a bias with fewer than
// twenty samples, because of gaps, is left out.
std::vector<SmallSignalPoint> find_small_signal(const Recording& recording,
                                                const std::vector<BiasSine>& sines);
inline std::vector<SmallSignalPoint> find_small_signal(const Recording& recording) {
  return find_small_signal(recording, bias_sines(recording));
}

}  // namespace ferrobench::recordings

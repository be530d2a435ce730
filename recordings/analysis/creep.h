// How a channel creeps in a hold, in SI units.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "recordings/analysis/bias_sines.h"
#include "recordings/analysis/signals.h"
#include "recordings/format/recording.h"

namespace ferrobench::recordings {

struct Hold {
  std::size_t number = 0;           // from 1, among those of find_holds()
  std::size_t first = 0, last = 0;  // samples, both ends included: the corner after the ramp, and the end
  double level = 0;                 // V/m
  double duration = 0;              // s
  double ramp_rate = 0;             // V/m/s, of the ramp before; 0 if there is none
  std::string label;
};
// The holds of the segment table with at least ten samples.
std::vector<Hold> find_holds(const Recording& recording);
// The long ones, in which creep is followed: of half the length of the longest or more, as short ones lead
// back to where the next begins. Not the stays at a bias before its sine (`sines`): they are short and many.
std::vector<Hold> long_holds(const Recording& recording, const std::vector<BiasSine>& sines);

struct Creep {
  Estimate change;                     // end minus start
  double range = 0;                    // largest minus smallest value within the hold
  std::optional<Estimate> per_decade;  // slope against log10(t / 1 s), t from the hold's start
  std::optional<double> time_to_half;  // s, when half of `change` has happened
};

// start and end: edge_reading(). The slope is fitted by least squares to means over tenths of a decade, from
// a hundredth of the hold (and at least three samples) on.
//
// Uncertainties (uncertainty.h): of the change from what both ends are read from; of the slope b from the
// means v_k, u^2(b) = sum of (x_k - x)^2 u^2(v_k) / (sum of (x_k - x)^2)^2, x_k = log10 t_k. Range and time
// to half have none: noise chooses the places from which they are read.
Creep measure_creep(const Recording& recording, const Signal& signal, const Hold& hold);

// The change since the start of the hold, `seconds` after it: the mean of the samples within a twentieth of a
// decade of that time on either side. Where they are fewer than eight, or the signal is exact, what lies
// between the two next samples. None where the hold does not go on for so long, or there is a gap.
std::optional<Estimate> creep_after(const Recording& recording, const Signal& signal, const Hold& hold,
                                    double seconds);
// The same as a curve to draw: means over fortieths of a decade of the time since the start; at most 16
// holds.
struct CreepCurve {
  Hold hold;
  std::vector<double> time, change;  // s, and in the signal's unit; NaN across a gap
};
std::vector<CreepCurve> creep_curves(const Recording& recording, const Signal& signal,
                                     const std::vector<BiasSine>& sines);
// 1, 2 and 5 of every decade [s], from three samples after the start of a hold on, for all of these holds.
std::vector<double> reading_times(const Recording& recording, const std::vector<Hold>& holds);

}  // namespace ferrobench::recordings

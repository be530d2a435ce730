// What one cycle's loops amount to, in SI units. Absent: the channel is, or the field never got there.
#pragma once

#include <optional>
#include <vector>

#include "recordings/analysis/cycles.h"
#include "recordings/analysis/signals.h"
#include "recordings/format/recording.h"

namespace ferrobench::recordings {

struct LoopMeasures {
  std::optional<Estimate> stroke;      // m
  std::optional<Estimate> force_span;  // N
  // Area within displacement against field, m V/m; both wings of a butterfly count as positive.
  std::optional<Estimate> displacement_area;
  // Field on the way back minus field on the way out, both at half stroke: where the displacement first
  // passes half its range and where it last does. V/m, without sign.
  std::optional<Estimate> width;
  // Integral of E dP around the loop: the energy turned into heat, J/m^3.
  std::optional<Estimate> energy;
  std::optional<Estimate> coercive_negative,
      coercive_positive;  // V/m, E where P passes zero, falling and rising
  std::optional<Estimate> remanent_falling, remanent_rising;  // C/m^2, P where E passes zero
};

// The recording outlives this. Polarization counts from the middle of its range over the recording unless the
// charge is absolute.
//
// Uncertainties (uncertainty.h): an extreme is read as local_fit.h says. Where y passes a level Y, x is read
// at the passing, with dx/dy the slope of the loop there:
//
//   u^2(x) = u^2(reading of x) + (dx/dy)^2 u^2(reading of y - Y)
//
// with what Y is read from, as half the stroke is; none is stated where y rests there, so that noise passes Y
// again and again. An area, integral of x dy, changes with x_i by (y_{i+1} - y_{i-1}) / 2 and with y_i by
// (x_{i+1} - x_{i-1}) / 2, and with the field at the ends where the loop does not close. An area between two
// ways has none where noise hides for long which of them is above, or where the field rests at a turn.
class LoopMeter {
 public:
  LoopMeter(const Recording& recording, const Turns& turns);
  LoopMeasures measure(const Cycle& cycle) const;
  // One by one, of the samples first..last.
  std::optional<Estimate> stroke(std::size_t first, std::size_t last) const;
  std::optional<Estimate> force_span(std::size_t first, std::size_t last) const;
  std::optional<Estimate> displacement_area(std::size_t first, std::size_t last) const;
  bool smoothed_any() const { return smoothed_any_; }
  bool centred() const { return centred_; }

 private:
  std::optional<Estimate> area(const Signal& y, double value, std::size_t first, std::size_t last) const;

  Signal field_, displacement_, force_, polarization_;  // smoothed; empty if not measured
  bool smoothed_any_ = false;
  bool centred_ = false;
  Reading middle_;  // of the polarization, if it is centred
};

}  // namespace ferrobench::recordings

// What one cycle's loops amount to, in SI units. Absent: the channel is, or the field never got there.
#pragma once

#include <optional>
#include <vector>

#include "recordings/analysis/cycles.h"
#include "recordings/analysis/signals.h"
#include "recordings/format/recording.h"

namespace ferrobench::recordings {

struct LoopMeasures {
  std::optional<double> displacement_low, displacement_high, stroke;  // m
  std::optional<double> force_span;                                   // N
  // Area within displacement against field, m V/m; both wings of a butterfly count as positive.
  std::optional<double> displacement_area;
  // Field on the way back minus field on the way out, both at half stroke: where the displacement first
  // passes half its range and where it last does. V/m, without sign.
  std::optional<double> width;
  // Integral of E dP around the loop: the energy turned into heat, J/m^3.
  std::optional<double> energy;
  std::optional<double> coercive_negative,
      coercive_positive;                                    // V/m, E where P passes zero, falling and rising
  std::optional<double> remanent_falling, remanent_rising;  // C/m^2, P where E passes zero
};

// The recording outlives this. Polarization counts from the middle of its range over the recording unless the
// charge is absolute.
class LoopMeter {
 public:
  LoopMeter(const Recording& recording, const Turns& turns);
  LoopMeasures measure(const Cycle& cycle) const;
  // One by one, of the samples first..last.
  std::optional<double> stroke(std::size_t first, std::size_t last) const;
  std::optional<double> force_span(std::size_t first, std::size_t last) const;
  std::optional<double> displacement_area(std::size_t first, std::size_t last) const;
  bool smoothed_any() const { return smoothed_any_; }
  bool centred() const { return centred_; }

 private:
  Signal field_, displacement_, force_, polarization_;  // smoothed; empty if not measured
  bool smoothed_any_ = false;
  bool centred_ = false;
};

}  // namespace ferrobench::recordings

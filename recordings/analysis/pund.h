// Pulses of a field, and positive-up-negative-down sequences of them.
//
// A pulse switches where the one before had the other sign. In a sequence P and N switch, U and D, each after
// one of its own sign, do not; the first pulse of a recording is neither.
#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <vector>

#include "recordings/analysis/signals.h"
#include "recordings/format/recording.h"

namespace ferrobench::recordings {

struct Pulse {
  // Samples: before it, at the largest field (the last one, where the field stays there), and back at none.
  std::size_t start, peak, end;
  bool up;
};

enum class PulseKind { p, u, n, d };

// Stretches of one sign above a twentieth of the largest field, from where the field begins to rise.
std::vector<Pulse> find_pulses(const Recording& recording);

// Of both signs two in a row, all about as high: 4 to 64 pulses.
bool is_pund(const Recording& recording, const std::vector<Pulse>& pulses);

struct PulseSequence {
  std::vector<Pulse> list;
  Signal polarization;  // C/m^2; the recording outlives it
};
// None unless that is what the recording is of.
std::optional<PulseSequence> pulse_sequence(const Recording& recording);

// One of each kind in a row, whichever comes first; by PulseKind, indices of pulses.
using PundCycle = std::array<std::optional<std::size_t>, 4>;
std::vector<PundCycle> pund_cycles(const std::vector<Pulse>& pulses);

// Changes of the polarization in a cycle, C/m^2: at the largest field, or left when the field is back at
// zero.
//   switched = ((P - U) + (|N| - |D|)) / 2,  non-switched = (U + |D|) / 2
// of the pairs that are whole; none without one. A sample that two of them are made of counts in both with
// its sign, so that uncertainties are those of the sums (uncertainty.h).
struct PundCharges {
  std::array<std::optional<Reading>, 4> change;  // by PulseKind, with their signs
  std::optional<Reading> switched() const;
  std::optional<Reading> non_switched() const;
};
PundCharges charges_of(const PundCycle& cycle, const PulseSequence& pulses, std::size_t Pulse::*at);

// What an aixACCT tester states of a sequence X U N D P, from the samples by its own definitions, C/m^2. The
// polarization counts from the middle of its values at the largest fields of N and P.
struct TesterFigures {
  Reading p_max;                        // at the largest field of P
  Reading relaxed_plus, relaxed_minus;  // Prrel+, Prrel-: where U and D begin
};
std::optional<TesterFigures> tester_figures(const PundCycle& cycle, const PulseSequence& pulses);

}  // namespace ferrobench::recordings

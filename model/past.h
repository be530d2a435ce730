// A specimen's past, as the simulator plays it before time 0.
//
// The specimen starts with all domains alike, at rest in the well or wells that its past names, and is then
// taken through the levels that were visited, or through its own program until both mean fractions repeat.
// Time is below 0 until then: what the bench does in time (drift, pickup, a prestress that relaxes, the
// charge amplifier) begins with the recording, what the specimen remembers does not. With tangents all of it
// is played in the same way; how often a program was repeated is decided by the values alone.
#pragma once

#include "model/simulator_state.h"

namespace ferrobench::model {

// Repetitions of a program at most. Of the loops of a ceramic the second is like the third to 1e-3 of the
// domains.
inline constexpr int most_cycles = 10;

// Pieces of field that are played at most: `knots` of a program, and what its past takes. Bounds on time
// follow from it.
std::size_t pieces_played(const protocols::Past* past, std::size_t knots);

// Starts the state before a program.
void start_after(Simulator::State& state, std::span<const double> knot_time,
                 std::span<const double> knot_field);
// Before a program that is not known yet.
void start_after(Simulator::State& state, double field);

}  // namespace ferrobench::model

// The turning points of a field program and the cycles between them.
//
// The program is the command, or the measured field where there is no command, without the sines of
// small_signal segments. A turning point is an extreme
// from which the program comes back by more than its noise; its first and last sample bound the time spent
// there. One level is the base: the one turned at most often, the earlier one of two. A cycle leads from the
// base to the base.
#pragma once

#include <cstddef>
#include <vector>

#include "recordings/analysis/bias_sines.h"
#include "recordings/format/recording.h"

namespace ferrobench::recordings {

struct Turn {
  std::size_t arrive = 0, leave = 0;  // samples
  double level = 0;                   // V/m
};

struct Cycle {
  std::size_t first = 0, last = 0;  // samples, both at the base
  double low = 0, high = 0;         // V/m, extremes of the program
  double rate = 0;                  // V/m/s, of its longest ramp
  std::vector<Turn> turns;          // between first and last
};

// Both ends of the program count as turning points. None if the program never changes.
struct Turns {
  std::vector<Turn> points;
  double span = 0, noise = 0;   // V/m, of the program
  std::vector<BiasSine> sines;  // that were taken out
};
Turns turning_points(const Recording& recording, std::vector<BiasSine> sines);
inline Turns turning_points(const Recording& recording) {
  return turning_points(recording, bias_sines(recording));
}
std::vector<Cycle> find_cycles(const Recording& recording, const Turns& turns);

}  // namespace ferrobench::recordings

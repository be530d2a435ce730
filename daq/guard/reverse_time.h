// How long a piece of the program stays below a field.
#pragma once

#include "protocols/waveform.h"

namespace ferrobench::daq {

// Times in s. A piece that never leaves has `whole` and its duration in all three.
struct TimeBelow {
  double at_start = 0;  // from the start of the piece until it first leaves
  double longest = 0;   // longest excursion within the piece
  double at_end = 0;    // of the excursion that goes on past its end
  bool whole = false;
};

TimeBelow linear_time_below(double from, double to, double duration, double threshold);
// Of a line or a sine. `duration` is the one it is played in; the piece's own may differ by the grid of
// samples.
TimeBelow time_below(const protocols::Piece& piece, double duration, double threshold);

// Adds pieces up to excursions that span them.
class ReverseTimer {
 public:
  // Longest excursion that this piece ends, goes on with, or holds within.
  double add(const TimeBelow& below);

 private:
  double running_ = 0;
};

}  // namespace ferrobench::daq

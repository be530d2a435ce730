// A recording cut at its cycles, for pictures of its loops.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "recordings/analysis/cycles.h"

namespace ferrobench::recordings {

struct Part {
  std::size_t first = 0, last = 0;   // samples, both included; neighbours share one
  std::optional<std::size_t> cycle;  // from 0; none: outside of every cycle
  double rate = 0;                   // V/m/s, of the cycle's longest ramp
  double frequency = 0;              // Hz, one over its duration
};

// What tells the cycles apart: their number, unless they differ in rate or, all of one range, in duration.
enum class ToldBy { cycle, rate, frequency };

struct Parts {
  std::vector<Part> parts;  // in order of time
  std::size_t cycles = 0;   // that the recording has
  ToldBy by = ToldBy::cycle;
  std::string label(const Part& part) const;  // "cycle 3", "10 kV/mm/s", "0.1 Hz"; "" outside of a cycle
};

// At most `most` cycles: the first, the last, and evenly spaced ones between, in the order of what tells them
// apart.
Parts parts_of(const Recording& recording, const std::vector<Cycle>& cycles, std::size_t most);

}  // namespace ferrobench::recordings

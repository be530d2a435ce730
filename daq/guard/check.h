// The whole program against the limits, before anything moves.
#pragma once

#include <vector>

#include "daq/guard/limits.h"
#include "protocols/waveform.h"

namespace ferrobench::daq {

// Every problem of the program as it will be sampled (a program with more corners than samples is slower than
// written). Exact: extremes, slews and times at reverse field come from the pieces, not from samples. Paths
// lead to the segment of the protocol; levels and rates are in the unit of its author. Of each kind of
// problem a segment has the worst.
std::vector<Problem> check(const protocols::SampledWaveform& program, const Limits& limits);

}  // namespace ferrobench::daq

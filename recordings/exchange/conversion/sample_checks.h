// Samples that are missing, or that cannot be as they are, by themselves. Each check adds what it found; none
// changes a sample.
#pragma once

#include "recordings/exchange/conversion/measured.h"

namespace ferrobench::recordings {

// One loop lasts 1/f.
void check_duration(Measured& m);
// What a tester plays ends where it began.
void check_return(Measured& m);
// Where the samples stand evenly, a longer step is where one is missing.
void check_steps(Measured& m);
// One or two samples that lie far beside their neighbours, in the columns that nothing else can tell of.
void check_spikes(Measured& m);

}  // namespace ferrobench::recordings

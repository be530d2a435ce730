// The creep protocol by Boost.odeint's rosenbrock4, each domain on its own with its own steps.
//
// The domains can be apart only where the stress is known. With a spring it is not, so there this run is
// given the right stress path, free of charge: its time is a lower bound of what a coupled one would need.
#pragma once

#include "tests/bench/creep.h"

namespace ferrobench::bench {

Outputs run_rosenbrock4(const Creep& creep, const StressPath& path, const PeerOptions& options);

}  // namespace ferrobench::bench

// The creep protocol by ferrobench's own simulator.
#pragma once

#include "model/simulator.h"
#include "tests/bench/creep.h"

namespace ferrobench::bench {

struct OurRun {
  Outputs outputs;
  std::vector<double> displacement;  // m
  double first_stress = 0;           // Pa, at time 0
  model::SimulationStatistics statistics;
};
OurRun run_ours(const Creep& creep, const model::SimulationOptions& options);

}  // namespace ferrobench::bench

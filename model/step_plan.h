// What the values alone decide in a run: the steps and which domains take part in each. A run can be recorded
// as a plan and other models be made to follow it, so that what comes out is a smooth function of the
// parameters.
#pragma once

#include <vector>

#include "model/physics/ensemble.h"

namespace ferrobench::model {

struct PlannedStep {
  double share = 0;   // of the duration of its piece of field
  bool last = false;  // of the piece
  InactiveSetChange change;
};

struct StepPlan {
  Lattice lattice;
  InactiveSetChange start;
  int cycles = 0;  // of a past that is the program itself
  std::vector<PlannedStep> steps;
};

}  // namespace ferrobench::model

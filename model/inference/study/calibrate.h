// The parametrized polycrystal from measured slow loops (section 4.3.2).
//
// From each sample of a slow loop between high field and zero: the driving force F_{+,90}(E, sigma) of
// (4.63), with E and sigma as measured, and x+ from the strain (4.65). On the way down F_unload(x+) is the
// force at which x+ was first reached, on the way up F_load(x+).
//
// The source takes the loop for quasi-static. Here the loop's own rate is allowed for: at the force where x+
// changes at the rate dx+/dt that was measured, the barrier is what that rate demands,
//
//   dg = (k T / V) ln(x / (tau |dx/dt|)),   F_cr = F + 4 sqrt(dg0 dg)        (x = x+ down, 1 - x+ up)
//
// so that the model gives the loop back at the rate at which it was measured. A second loop at another
// prestress gives the linear shift with prestress: the mean difference of both loops' branches.
//
// At its tips a loop turns: the branch that leaves the tip (load at the bottom, unload at the top) starts at
// the other one and only then becomes the major branch, and the arriving one creeps on past the turn. Loops
// at other prestress, rate or reversals go through these fractions and beyond, and where the branches meet or
// cross neither way has a barrier and x+ drifts off. So the table is made well formed:
//   - both branches fall with x+, as the arriving one went before the turn;
//   - the leaving branch keeps half of the loop's median gap between the branches;
//   - beyond the loop's fractions the arriving branch goes on straight by the slope of its last quarter, and
//     the other one in parallel, down to x+ = 0 and up to x+ = 1.
//
// What strain cannot see: a domain that goes on to -180 looks like +180, but brings 2 P_r of charge. The
// displacement of the loop comes back, its charge lacks those domains (in the test's loop 2 % of them, 8 % of
// the charge's range).
#pragma once

#include <optional>
#include <vector>

#include "model/model.h"
#include "recordings/format/recording.h"

namespace ferrobench::model {

struct CalibrateOptions {
  int points = 60;               // of each branch
  double smallest_range = 0.02;  // of x+; less is no loop to calibrate from
};

// `model` gives the material's constants and comes back with the method "parametrized" and its table. Throws
// Error(bad_recording) if a channel is missing or the loop does not switch, or goes to a field below zero by
// more than half of its top (where the source's two phases do not suffice).
Model calibrate_parametrized(const Model& model, const recordings::Recording& loop,
                             const recordings::Recording* other_prestress = nullptr,
                             const CalibrateOptions& options = {});

}  // namespace ferrobench::model

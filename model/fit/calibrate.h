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
#pragma once

#include <optional>
#include <vector>

#include "model/model.h"
#include "recordings/recording.h"

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

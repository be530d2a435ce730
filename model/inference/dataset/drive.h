// The drive of a recording as a polygon: its command at its corners or, where no command was recorded, the
// straight lines that the measured field runs along, by least squares over all samples.
//
// A drive that was read from the measured field is uncertain. With A the normal matrix of the least squares
// over levels and corner times and s^2 the long-run variance of the field's noise (white noise's variance
// plus its covariances with its neighbours), the covariance of the knots is s^2 A^-1; `knot_error` is a
// square root of it, s L^-T with A = L L^T.
#pragma once

#include "model/inference/dataset/bench.h"

namespace ferrobench::model::inference {

// Fills in the knots and, if the drive was read from the field, their uncertainty. Throws
// Error(bad_recording) if neither channel holds a drive.
void set_drive(BenchRecording& out, const recordings::Recording& recording);

}  // namespace ferrobench::model::inference

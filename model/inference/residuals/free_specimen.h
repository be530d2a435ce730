// Recordings of a specimen that nothing pushes against, as a separable problem (residuals/separable.h).
#pragma once

#include <memory>

#include "model/inference/residuals/separable.h"
#include "model/inference/residuals/simulated_rows.h"

namespace ferrobench::model {

// Null if a spring pushes, if the model has effects that are not of the kinetics (some change what enters
// linearly), or if not all of the parameters that go into the groups are free. `data` must outlive it.
std::unique_ptr<Separable> free_specimen(const Model& model, const std::vector<FreeParameter>& free,
                                         const std::vector<RecordingData>& data);

}  // namespace ferrobench::model

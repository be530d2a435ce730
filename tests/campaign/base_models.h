// Base models of benches: soft PZT with its constants spread, and the same one as it really is.
#pragma once

#include <vector>

#include "model/model.h"
#include "tests/campaign/draw.h"

namespace ferrobench::campaign {

// Of material, polycrystal and, where there are any, passive layers.
std::vector<double*> base_parameters(model::Model& model);
model::Model draw_base(Draw& draw);
// Every parameter moved by 5 to 10 %, the load by 1 to 2 %; `far` of them by 10 to 20 % more.
model::Model move_parameters(const model::Model& model, Draw& draw, int far);

}  // namespace ferrobench::campaign

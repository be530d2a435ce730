// What a recalibration moved, in sentences.
#pragma once

#include <string>
#include <vector>

#include "model/inference/study/discover.h"

namespace ferrobench::model {

// By more than twice its standard deviation and half a percent.
std::vector<std::string> moved_parameters(const Discovery& d);
// What is known of the parameter or the instrument speaks against these moves: a finding in themselves.
std::vector<std::string> astonishing_moves(const Discovery& d);

}  // namespace ferrobench::model

// The pictures of a discovery: what is missing, and measured, before and after where that is seen best.
#pragma once

#include <string>

#include "model/inference/study/discover.h"

namespace ferrobench::model {

// A section of the HTML report; empty if there is nothing to draw.
std::string pictures(const Discovery& discovery);

}  // namespace ferrobench::model

// Segments into moves: one function for each kind.
#pragma once

#include <string>
#include <vector>

#include "protocols/builder.h"
#include "protocols/segments.h"

namespace ferrobench::protocols {

// Labels begin with `prefix`; `recorded` is for segments that do not say themselves how they are recorded.
// Throws Error(bad_protocol) when the program gets too long, too steep or too late.
void expand(const std::vector<Node>& nodes, const std::string& prefix, const Recorded& recorded,
            Builder& builder);

}  // namespace ferrobench::protocols

// Segments into moves: one function for each kind.
#pragma once

#include <string>
#include <vector>

#include "protocols/builder.h"
#include "protocols/segments.h"

namespace ferrobench::protocols {

// Labels begin with `prefix`. Throws Error(bad_protocol) when the program gets too long, too steep or too
// late.
void expand(const std::vector<Node>& nodes, const std::string& prefix, Builder& builder);

}  // namespace ferrobench::protocols

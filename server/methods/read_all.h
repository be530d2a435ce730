// The recordings that a job or a view works on.
#pragma once

#include <string>
#include <vector>

#include "recordings/format/recording.h"
#include "server/engine/engine.h"

namespace ferrobench::server {

// All together they take no more memory than one may. Error(bad_recording) names the one that is too much.
std::vector<recordings::Recording> read_all(const Engine& engine, const std::vector<std::string>& names,
                                            const Jobs::Handle* job = nullptr);

}  // namespace ferrobench::server

// What a recording says before its first sample.
#pragma once

#include "server/engine/run.h"

namespace ferrobench::server {

recordings::Header header_of(const RunSetup& setup, const bench::Prepared& prepared);

}  // namespace ferrobench::server

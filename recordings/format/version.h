// The version and commit of the program that writes a recording.
#pragma once

#include <string_view>

namespace ferrobench::recordings {

std::string_view software_version();  // "0.1.0"
std::string_view software_commit();   // as of configuring the build; "unknown" outside a git clone

}  // namespace ferrobench::recordings

// What a device's description says of each of its channels.
#pragma once

#include <array>
#include <nlohmann/json.hpp>

#include "recordings/format/recording.h"

namespace ferrobench::recordings {

// The number under `key` in "channels" of the description, by Channel; 0 where nothing positive and finite
// stands there. A replay has those of what it plays.
std::array<double, 5> stated_by_channel(const nlohmann::json& device, const char* key);

}  // namespace ferrobench::recordings

// The field program that a recording names, for analyses that ask what was meant to be played.
#pragma once

#include <nlohmann/json.hpp>
#include <optional>

#include "protocols/waveform.h"

namespace ferrobench::recordings {

// None for what is no protocol. Takes as long as expanding it does.
std::optional<protocols::Waveform> program_of(const nlohmann::json& protocol);

}  // namespace ferrobench::recordings

// The parts of a recording as texts of JSON: in the journal, and from the child that reads a file to its
// parent.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "recordings/format/parts.h"

namespace ferrobench::recordings {

inline constexpr std::uint64_t most_text = 1u << 28;  // bytes

std::string begin_text(const Begin& begin);
std::string event_text(const Event& event);
std::string ending_text(const Ending& ending);
// Error(bad_recording) if it is something else, with its place.
Begin begin_of(std::string_view text);
Event event_of(std::string_view text);
Ending ending_of(std::string_view text);

}  // namespace ferrobench::recordings

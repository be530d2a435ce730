// Moments as ISO 8601 text in UTC, as the recording keeps them.
#pragma once

#include <optional>
#include <string>

namespace ferrobench::recordings {

std::string iso_now();  // "2026-01-01T12:00:00.000000Z"

// The moment `seconds` after `start`, in UTC. None if `start` is not "YYYY-MM-DDThh:mm:ss[.fff](Z | +hh:mm |
// -hh:mm)".
std::optional<std::string> iso_after(const std::string& start, double seconds);

}  // namespace ferrobench::recordings

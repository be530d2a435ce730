// A whole session with a unit whose every answer comes out of a string of bytes: open, start, read, stop,
// close. For fuzzing: whatever the bytes, nothing may crash, hang, or hand on a torn block.
#pragma once

#include <cstddef>
#include <span>

namespace ferrobench::daq::usb {

// Rows that were handed on. Throws std::logic_error if the driver broke a promise.
std::size_t run_session(std::span<const std::byte> answers);

}  // namespace ferrobench::daq::usb

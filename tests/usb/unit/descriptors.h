// What the unit tells of itself at enumeration, and the standard requests (USB 2.0, chapter 9). What the
// protocol note does not know (bMaxPower, string indices) is made up.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "unit/unit_setup.h"

namespace ferrobench::emulator {

struct Request {
  std::uint8_t type = 0, number = 0;
  std::uint16_t value = 0, index = 0, length = 0;
};

std::vector<std::byte> device_descriptor(const UnitSetup& setup);
std::vector<std::byte> configuration_descriptor(const UnitSetup& setup);
// Nothing: a stall.
std::optional<std::vector<std::byte>> standard_in(const UnitSetup& setup, const Request& request);

}  // namespace ferrobench::emulator

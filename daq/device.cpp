#include "daq/device.h"

namespace ferrobench::daq {

std::string_view block_status_name(BlockStatus status) {
  constexpr std::array<std::string_view, 9> names{
      "ok", "overrun", "underrun", "timeout", "short_data", "stall", "device_lost", "clipped", "misaligned"};
  return names.at(static_cast<std::size_t>(status));
}

}  // namespace ferrobench::daq

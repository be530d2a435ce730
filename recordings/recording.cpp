#include "recordings/recording.h"

namespace ferrobench::recordings {

std::string_view channel_name(Channel channel) {
  constexpr std::array<std::string_view, 5> names{"command", "field", "charge", "displacement", "force"};
  return names.at(static_cast<std::size_t>(channel));
}

std::string_view channel_unit(Channel channel) {
  constexpr std::array<std::string_view, 5> units{"V/m", "V/m", "C", "m", "N"};
  return units.at(static_cast<std::size_t>(channel));
}

}  // namespace ferrobench::recordings

#include "recordings/analysis/device_channels.h"

#include <cmath>

namespace ferrobench::recordings {

std::array<double, 5> stated_by_channel(const nlohmann::json& device, const char* key) {
  constexpr int most_replays = 16;  // of replays
  const auto* described = &device;
  for (int i = 0; i < most_replays && described->is_object() && described->contains("recorded_with"); ++i)
    described = &described->at("recorded_with");
  std::array<double, 5> out{};
  if (!described->is_object() || !described->contains("channels") || !described->at("channels").is_array())
    return out;
  for (const auto& c : described->at("channels")) {
    if (!c.is_object() || !c.contains("channel") || !c.contains(key) || !c[key].is_number()) continue;
    const double value = c[key].get<double>();
    for (const auto channel : all_channels)
      if (c["channel"] == channel_name(channel) && std::isfinite(value) && value > 0)
        out[static_cast<std::size_t>(channel)] = value;
  }
  return out;
}

}  // namespace ferrobench::recordings

#include "recordings/analysis/skew.h"

#include <algorithm>
#include <cmath>

namespace ferrobench::recordings {

std::array<double, 5> skew_of(const nlohmann::json& device) {
  constexpr int most_replays = 16;  // of replays
  const auto* described = &device;
  for (int i = 0; i < most_replays && described->is_object() && described->contains("recorded_with"); ++i)
    described = &described->at("recorded_with");
  std::array<double, 5> out{};
  if (!described->is_object() || !described->contains("channels") || !described->at("channels").is_array())
    return out;
  for (const auto& c : described->at("channels")) {
    if (!c.is_object() || !c.contains("channel") || !c.contains("skew_s") || !c["skew_s"].is_number())
      continue;
    const double skew = c["skew_s"].get<double>();
    for (const auto channel : all_channels)
      if (c["channel"] == channel_name(channel) && std::isfinite(skew) && skew > 0)
        out[static_cast<std::size_t>(channel)] = skew;
  }
  return out;
}

bool remove_skew(Recording& recording) {
  const auto skews = skew_of(recording.header.device);
  const auto& time = recording.time;
  for (const auto channel : all_channels) {
    const double skew = skews[static_cast<std::size_t>(channel)];
    if (skew == 0 || !recording.has(channel)) continue;
    auto& values = *recording.channels[static_cast<std::size_t>(channel)];
    for (std::size_t i = values.size(); i-- > 1;) {
      const double share = skew / (time[i] - time[i - 1]);
      if (!(share > 0 && share < 1) || !std::isfinite(values[i - 1])) continue;
      values[i] -= share * (values[i] - values[i - 1]);
    }
  }
  return std::ranges::any_of(skews, [](double s) { return s > 0; });
}

}  // namespace ferrobench::recordings

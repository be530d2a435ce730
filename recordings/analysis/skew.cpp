#include "recordings/analysis/skew.h"

#include <algorithm>
#include <cmath>

#include "recordings/analysis/device_channels.h"

namespace ferrobench::recordings {

std::array<double, 5> skew_of(const nlohmann::json& device) {
  return stated_by_channel(device, "skew_s");
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

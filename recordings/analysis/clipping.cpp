#include "recordings/analysis/clipping.h"

#include <algorithm>
#include <cmath>

#include "base/number_text.h"

namespace ferrobench::recordings {
namespace {

// The lowest count is one more than the highest without its sign; a sensor with a table ends at the same on
// both sides.
bool at_limit(std::int16_t count) {
  return count == 32767 || count <= -32767;
}

std::size_t index_of(Channel channel) {
  return static_cast<std::size_t>(channel);
}

}  // namespace

Clipping::Clipping(const Recording& r) : recording_(r) {
  std::array<bool, 5> counted{};
  const auto add = [&](Channel channel, std::size_t at) {
    auto& list = stretches_.at(index_of(channel));
    if (list.empty() || list.back().last + 1 < at)
      list.push_back({at, at});
    else
      list.back().last = at;
  };
  const auto width = r.raw ? r.raw->columns.size() : 0;
  for (std::size_t c = 0; c < width; ++c) {
    const auto channel = r.raw->columns[c].channel;
    if (!r.has(channel) || r.raw->counts.size() < r.size() * width) continue;
    counted.at(index_of(channel)) = true;
    const auto& values = r.at(channel);
    for (std::size_t i = 0; i < r.size(); ++i)  // a gap has the lowest count
      if (at_limit(r.raw->counts[i * width + c]) && !std::isnan(values[i])) add(channel, i);
  }
  for (const auto& event : r.events) {
    if (event.kind != "clipped" || !std::isfinite(event.time) || r.size() == 0) continue;
    const auto after =
        static_cast<std::size_t>(std::ranges::lower_bound(r.time, event.time) - r.time.begin());
    for (const auto channel : all_channels)
      if (!counted.at(index_of(channel)) && event.message.find(channel_name(channel)) != std::string::npos)
        add(channel, std::min(after, r.size() - 1));
  }
}

bool Clipping::any(std::span<const Channel> channels, std::size_t first, std::size_t last) const {
  return std::ranges::any_of(channels, [&](Channel channel) {
    const auto& list = stretches_.at(index_of(channel));
    const auto found = std::ranges::lower_bound(list, first, {}, &Stretch::last);
    return found != list.end() && found->first <= last;
  });
}

std::string Clipping::in_words(Channel channel) const {
  const auto& list = stretches_.at(index_of(channel));
  std::size_t samples = 0;
  for (const auto& stretch : list) samples += stretch.last - stretch.first + 1;
  std::string out(channel_name(channel));
  if (samples == 0) return out;
  return out + ": " + std::to_string(samples) + (samples == 1 ? " sample" : " samples") + " from " +
         number_text(recording_.time[list.front().first]) + " s to " +
         number_text(recording_.time[list.back().last]) + " s";
}

}  // namespace ferrobench::recordings

#include "recordings/format/sound.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"

namespace ferrobench::recordings {
namespace {

[[noreturn]] void refuse(const std::string& place, const std::string& message, std::size_t at,
                         const std::string& file) {
  throw Error(ErrorCode::bad_recording, "the file is not a readable recording",
              Problem{.path = place, .message = message + std::to_string(at), .given = file});
}

}  // namespace

void demand_rising(std::span<const double> time, std::size_t from, const std::string& file) {
  for (std::size_t i = from; i < time.size(); ++i) {
    if (!std::isfinite(time[i])) refuse("/entry/data/time", "is not finite at sample ", i, file);
    if (i > 0 && !(time[i] > time[i - 1])) refuse("/entry/data/time", "does not rise at sample ", i, file);
  }
}

void demand_finite(Channel channel, std::span<const double> values, std::size_t from,
                   const std::string& file) {
  for (std::size_t i = from; i < values.size(); ++i)
    if (std::isinf(values[i])) refuse(channel_place(channel), "is infinite at sample ", i, file);
}

void demand_sound(const Recording& r, const std::string& file) {
  demand_rising(r.time, 0, file);
  for (const auto channel : all_channels)
    if (r.has(channel)) demand_finite(channel, r.at(channel), 0, file);
  for (std::size_t i = 0; i < r.segments.size(); ++i) {
    const auto& s = r.segments[i];
    if (s.start_sample < 0 || s.end_sample < s.start_sample ||
        s.end_sample > static_cast<std::int64_t>(r.size()))
      refuse("/entry/segments/end_sample", "leaves the recording at segment ", i, file);
    if (!std::isfinite(s.level) || !std::isfinite(s.rate))
      refuse("/entry/segments/level", "is not finite at segment ", i, file);
  }
}

std::vector<SegmentRow> within(std::span<const SegmentRow> segments, std::uint64_t rows) {
  std::vector<SegmentRow> out;
  const auto end = static_cast<std::int64_t>(rows);
  for (auto segment : segments) {
    if (segment.start_sample >= end) continue;
    segment.end_sample = std::min(segment.end_sample, end);
    out.push_back(std::move(segment));
  }
  return out;
}

}  // namespace ferrobench::recordings

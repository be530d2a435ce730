#include "recordings/analysis/window.h"

#include <algorithm>

#include "base/error.h"

namespace ferrobench::recordings {
namespace {

template <class T>
void keep(std::vector<T>& values, std::size_t first, std::size_t last) {
  values.erase(values.begin() + static_cast<std::ptrdiff_t>(last), values.end());
  values.erase(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(first));
}

void keep_segments(std::vector<SegmentRow>& segments, std::int64_t first, std::int64_t last) {
  for (auto& s : segments) {
    s.start_sample = std::max(s.start_sample, first) - first;
    s.end_sample = std::min(s.end_sample, last) - first;
  }
  std::erase_if(segments, [](const auto& s) { return s.end_sample <= s.start_sample; });
}

}  // namespace

Recording window(Recording r, std::optional<double> from, std::optional<double> to) {
  if (!from && !to) return r;
  const auto begin = from ? std::ranges::lower_bound(r.time, *from) : r.time.begin();
  const auto end = to ? std::ranges::upper_bound(r.time, *to) : r.time.end();
  if (end - begin < 2) {
    nlohmann::json allowed;
    if (!r.time.empty()) allowed = {{"from", r.time.front()}, {"to", r.time.back()}};
    throw Error(ErrorCode::invalid_params, "the window holds fewer than two samples",
                Problem{.path = from ? "/from" : "/to",
                        .given = {from ? nlohmann::json(*from) : nlohmann::json(),
                                  to ? nlohmann::json(*to) : nlohmann::json()},
                        .allowed = allowed,
                        .unit = "s",
                        .hint = "choose a part of the recording"});
  }
  const auto first = static_cast<std::size_t>(begin - r.time.begin());
  const auto last = static_cast<std::size_t>(end - r.time.begin());
  if (first > 0) r.header.past = {};
  const double start = *begin, stop = *(end - 1);
  const bool to_the_end = last == r.time.size();

  keep(r.time, first, last);
  for (auto& t : r.time) t -= start;
  for (auto& channel : r.channels)
    if (channel) keep(*channel, first, last);
  for (auto& other : r.others) keep(other.values, first, last);
  if (r.raw) {
    const auto width = r.raw->columns.size();
    keep(r.raw->counts, first * width, last * width);
  }
  keep_segments(r.segments, static_cast<std::int64_t>(first), static_cast<std::int64_t>(last));
  std::erase_if(r.events, [&](const Event& e) { return e.time < start || (!to_the_end && e.time > stop); });
  for (auto& e : r.events) e.time -= start;
  // How the run ended is no part of what came before.
  if (!to_the_end) {
    r.status = "complete";
    r.reason.clear();
  }
  return r;
}

}  // namespace ferrobench::recordings

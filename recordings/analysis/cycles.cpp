#include "recordings/analysis/cycles.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "recordings/analysis/loops.h"
#include "recordings/analysis/segments.h"
#include "recordings/analysis/statistics.h"

namespace ferrobench::recordings {
namespace {

// Sines on a bias are no turns of the program: they are taken out.
std::vector<double> program(const Recording& r, const std::vector<BiasSine>& sines) {
  auto out = r.at(r.has(Channel::command) ? Channel::command : Channel::field);
  for (const auto& s : sines) {
    const double turn = 2 * std::numbers::pi * s.cycles / (r.time[s.last] - r.time[s.first]);
    for (auto i = s.first; i <= s.last; ++i)
      out[i] -= s.amplitude * std::sin(turn * (r.time[i] - r.time[s.first]));
  }
  return out;
}

// The ramps alone, without those sines.
std::vector<SegmentRow> ramps_of(const Recording& r, const std::vector<BiasSine>& sines) {
  auto out = segments_of(r);
  std::erase_if(out, [&](const SegmentRow& row) {
    return row.kind != "ramp" || std::ranges::any_of(sines, [&](const BiasSine& s) {
             return s.first == static_cast<std::size_t>(row.start_sample);
           });
  });
  return out;
}

// Around an extreme: the samples that do not differ from it by more than noise.
Turn plateau(const std::vector<double>& values, std::size_t at, std::size_t from, std::size_t to,
             double tolerance) {
  Turn turn{at, at, 0};
  for (std::size_t i = at; i > from && std::abs(values[i - 1] - values[at]) <= tolerance; --i)
    turn.arrive = i - 1;
  for (std::size_t i = at; i < to && std::abs(values[i + 1] - values[at]) <= tolerance; ++i)
    turn.leave = i + 1;
  turn.level =
      tolerance > 0 ? mean(std::span(values).subspan(turn.arrive, turn.leave - turn.arrive + 1)) : values[at];
  return turn;
}

double ramp_rate(const std::vector<SegmentRow>& ramps, std::size_t first, std::size_t last) {
  double longest = 0, rate = 0;
  for (const auto& row : ramps) {
    const double shared =
        static_cast<double>(std::min<std::int64_t>(row.end_sample, static_cast<std::int64_t>(last))) -
        static_cast<double>(std::max<std::int64_t>(row.start_sample, static_cast<std::int64_t>(first)));
    if (shared <= longest) continue;
    longest = shared;
    rate = row.rate;
  }
  return rate;
}

// The level turned at most often; the ends of the program count half.
double base_level(const std::vector<Turn>& turns, double tolerance) {
  double best = turns.front().level;
  int most = 0;
  for (const auto& candidate : turns) {
    int weight = 0;
    for (std::size_t i = 0; i < turns.size(); ++i)
      if (std::abs(turns[i].level - candidate.level) <= tolerance)
        weight += i == 0 || i + 1 == turns.size() ? 1 : 2;
    if (weight > most) {
      most = weight;
      best = candidate.level;
    }
  }
  return best;
}

}  // namespace

Turns turning_points(const Recording& recording, std::vector<BiasSine> sines) {
  if (!recording.has(Channel::command) && !recording.has(Channel::field)) return {};
  const auto values = program(recording, sines);
  const auto range = extremes(values);
  if (!range || !(range->span() > 0)) return {};
  const double span = range->span(), noise = estimate_noise(values);
  const double back = std::max(10 * noise, 1e-3 * span);

  std::vector<std::size_t> corners;
  std::size_t low = values.size(), high = values.size(), first = values.size(), last = 0;
  int direction = 0;
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (std::isnan(values[i])) continue;
    if (first == values.size()) first = low = high = i;
    last = i;
    if (values[i] < values[low]) low = i;
    if (values[i] > values[high]) high = i;
    if (direction <= 0 && values[i] - values[low] > back) {
      corners.push_back(low);
      direction = 1;
      high = i;
    } else if (direction >= 0 && values[high] - values[i] > back) {
      corners.push_back(high);
      direction = -1;
      low = i;
    }
  }
  if (corners.empty()) return {};
  if (corners.front() != first && std::abs(values[first] - values[corners.front()]) > back)
    corners.insert(corners.begin(), first);
  corners.push_back(direction > 0 ? high : low);
  Turns turns{.points = {}, .span = span, .noise = noise, .sines = std::move(sines)};
  for (std::size_t k = 0; k < corners.size(); ++k)
    turns.points.push_back(plateau(values, corners[k], k > 0 ? corners[k - 1] : first,
                                   k + 1 < corners.size() ? corners[k + 1] : last,
                                   std::max(5 * noise, 1e-9 * span)));
  return turns;
}

std::vector<Cycle> find_cycles(const Recording& recording, const Turns& turns) {
  const auto& points = turns.points;
  if (points.empty()) return {};
  const auto ramps = ramps_of(recording, turns.sines);
  const double tolerance = std::max(5 * turns.noise, 0.01 * turns.span);
  const double base = base_level(points, tolerance);
  std::vector<Cycle> cycles;
  std::size_t start = points.size();
  for (std::size_t k = 0; k < points.size(); ++k) {
    if (std::abs(points[k].level - base) > tolerance) continue;
    if (start < k) {
      Cycle cycle{.first = points[start].leave,
                  .last = points[k].arrive,
                  .low = base,
                  .high = base,
                  .rate = 0,
                  .turns = {}};
      for (std::size_t i = start + 1; i < k; ++i) {
        cycle.low = std::min(cycle.low, points[i].level);
        cycle.high = std::max(cycle.high, points[i].level);
        cycle.turns.push_back(points[i]);
      }
      cycle.rate = ramp_rate(ramps, cycle.first, cycle.last);
      if (!cycle.turns.empty()) cycles.push_back(std::move(cycle));
    }
    start = k;
  }
  return cycles;
}

}  // namespace ferrobench::recordings

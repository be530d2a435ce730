#include "recordings/analysis/parts.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <set>

#include "base/number_text.h"
#include "base/units.h"

namespace ferrobench::recordings {
namespace {

constexpr double alike = 1.02;

bool of_one_range(const std::vector<Cycle>& cycles) {
  const auto& first = cycles.front();
  const double span = first.high - first.low;
  return std::ranges::all_of(cycles, [&](const Cycle& c) {
    return std::abs(c.high - first.high) + std::abs(c.low - first.low) < 2 * (alike - 1) * span;
  });
}

ToldBy told_by(const std::vector<Cycle>& cycles, const std::vector<Part>& parts) {
  if (parts.size() < 2) return ToldBy::cycle;
  if (of_one_range(cycles)) {
    const auto [slow, fast] = std::ranges::minmax(parts, {}, &Part::frequency);
    return fast.frequency > alike * slow.frequency ? ToldBy::frequency : ToldBy::cycle;
  }
  // A single odd cycle, or noise, makes no difference in rate.
  auto rates = parts;
  std::ranges::sort(rates, {}, &Part::rate);
  const double low = rates[rates.size() / 4].rate, high = rates[rates.size() * 3 / 4].rate;
  return low > 0 && high > alike * low ? ToldBy::rate : ToldBy::cycle;
}

}  // namespace

std::string Parts::label(const Part& part) const {
  if (!part.cycle) return "";
  switch (by) {
    case ToldBy::rate:
      return number_text(part.rate / volts_per_m_in_kv_per_mm) + " kV/mm/s";
    case ToldBy::frequency:
      return number_text(part.frequency) + " Hz";
    case ToldBy::cycle:
      break;
  }
  return "cycle " + std::to_string(*part.cycle + 1);
}

Parts parts_of(const Recording& recording, const std::vector<Cycle>& cycles, std::size_t most) {
  Parts out{.parts = {}, .cycles = cycles.size()};
  if (recording.size() == 0) return out;
  std::vector<Part> all;
  all.reserve(cycles.size());
  for (const auto& cycle : cycles)
    all.push_back({cycle.first, cycle.last, all.size(), cycle.rate,
                   1 / (recording.time[cycle.last] - recording.time[cycle.first])});
  if (!all.empty()) out.by = told_by(cycles, all);
  std::vector<std::size_t> order(all.size());
  std::iota(order.begin(), order.end(), 0);
  std::ranges::stable_sort(order, {}, [&](std::size_t i) {
    return out.by == ToldBy::rate ? all[i].rate : out.by == ToldBy::frequency ? all[i].frequency : 0;
  });
  std::set<std::size_t> chosen;
  const std::size_t count = std::min(most, all.size());
  for (std::size_t k = 0; k < count; ++k)
    chosen.insert(order[count < 2 ? 0 : k * (all.size() - 1) / (count - 1)]);
  std::size_t at = 0;
  const auto outside = [&](std::size_t until) {
    if (at < until) out.parts.push_back({.first = at, .last = until, .cycle = {}});
  };
  for (const auto& part : all) {
    outside(part.first);
    if (chosen.contains(*part.cycle)) out.parts.push_back(part);
    at = part.last;
  }
  outside(recording.size() - 1);
  return out;
}

}  // namespace ferrobench::recordings

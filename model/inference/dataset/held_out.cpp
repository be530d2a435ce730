#include "model/inference/dataset/held_out.h"

#include <algorithm>
#include <cmath>
#include <map>

namespace ferrobench::model::inference {

std::vector<bool> choose_held_out(const std::vector<BenchRecording>& recordings,
                                  const std::set<std::size_t>& never) {
  const std::size_t n = recordings.size();
  std::vector<bool> out(n, false);
  if (n < 3) return out;
  // What a recording can show: its classes of segment, its load, and the decade of its duration.
  std::vector<std::set<std::string>> shows(n);
  for (std::size_t i = 0; i < n; ++i) {
    const auto& r = recordings[i];
    std::map<SegmentClass, std::size_t> counts;
    for (const auto s : r.segment_class) ++counts[s];
    for (const auto& [s, count] : counts)
      if (50 * count > r.segment_class.size()) shows[i].insert(std::string(segment_class_name(s)));
    shows[i].insert("prestress " + std::to_string(std::lround(r.header.load.prestress / 1e5)));
    shows[i].insert("spring " + std::to_string(std::lround(r.header.load.spring_stiffness / 1e4)));
    shows[i].insert("decade " + std::to_string(std::lround(std::log10(r.duration()))));
  }
  const std::size_t take = std::max<std::size_t>(1, n / 4);
  // One after the other, each time the one that is missed least.
  const auto worth = [&](const std::vector<bool>& held) {
    std::map<std::string, int> trained, locked;
    for (std::size_t i = 0; i < n; ++i)
      for (const auto& s : shows[i]) ++(held[i] ? locked : trained)[s];
    // Losing a kind for the training costs more than not proving it.
    double sum = 10 * static_cast<double>(trained.size()) + static_cast<double>(locked.size());
    for (const auto& [s, count] : trained) sum += 0.1 * std::min(count, 3);
    return sum;
  };
  for (std::size_t k = 0; k < take; ++k) {
    std::size_t best = n;
    double most = -1;
    for (std::size_t i = 0; i < n; ++i) {
      if (out[i] || never.contains(i)) continue;
      auto trial = out;
      trial[i] = true;
      if (const double w = worth(trial); w > most) {
        most = w;
        best = i;
      }
    }
    if (best < n) out[best] = true;
  }
  return out;
}

}  // namespace ferrobench::model::inference

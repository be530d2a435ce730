#include "tests/bench/program.h"

#include <algorithm>

namespace ferrobench::bench {

StressPath::StressPath(const std::vector<CreepPiece>& fine, double first, const std::vector<double>& stress) {
  std::size_t done = 0;
  double last = first;
  for (const auto& piece : fine) {
    Knots k;
    k.time = {piece.start};
    k.stress = {last};
    for (const double t : piece.times) {
      k.time.push_back(t);
      k.stress.push_back(stress[done++]);
    }
    last = k.stress.back();
    const std::size_t n = k.time.size();
    for (std::size_t i = 0; i < n; ++i) {
      const std::size_t a = i > 0 ? i - 1 : 0, b = std::min(i + 1, n - 1);
      k.slope.push_back((k.stress[b] - k.stress[a]) / (k.time[b] - k.time[a]));
    }
    // One-sided at the ends, of second order.
    const double h = k.time[1] - k.time[0];
    k.slope[0] = (-3 * k.stress[0] + 4 * k.stress[1] - k.stress[2]) / (2 * h);
    k.slope[n - 1] = (3 * k.stress[n - 1] - 4 * k.stress[n - 2] + k.stress[n - 3]) / (2 * h);
    pieces_.push_back(std::move(k));
  }
}

StressPath::Value StressPath::at(std::size_t piece, double time) const {
  if (pieces_.empty()) return {constant_, 0};
  const auto& k = pieces_[piece];
  const double h = k.time[1] - k.time[0];
  const auto i = static_cast<std::size_t>(
      std::clamp((time - k.time[0]) / h, 0.0, static_cast<double>(k.time.size()) - 2));
  const double u = (time - k.time[i]) / h, v = 1 - u;
  const double rise = k.stress[i + 1] - k.stress[i];
  return {v * v * (1 + 2 * u) * k.stress[i] + u * u * (1 + 2 * v) * k.stress[i + 1] +
              h * u * v * (v * k.slope[i] - u * k.slope[i + 1]),
          6 * u * v * rise / h + v * (v - 2 * u) * k.slope[i] + u * (u - 2 * v) * k.slope[i + 1]};
}

}  // namespace ferrobench::bench

#include "recordings/analysis/forc.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "recordings/analysis/signals.h"

namespace ferrobench::recordings {
namespace {

constexpr std::size_t least_curves = 8, most_curves = 80;

bool go_one_way(const std::vector<Cycle>& cycles) {
  const double whole = cycles.back().low - cycles.front().low;
  const double step = std::abs(whole) / static_cast<double>(cycles.size() - 1);
  for (std::size_t i = 0; i < cycles.size(); ++i) {
    if (cycles[i].turns.size() != 1 || cycles[i].turns.front().level > cycles[i].high) return false;
    if (i > 0 && (cycles[i].low - cycles[i - 1].low) * std::copysign(1, whole) < 0.2 * step) return false;
  }
  return step > 0;
}

// The means of the rising branch over each step of the grid, empty steps filled by straight lines.
std::vector<double> rising_branch(const Cycle& cycle, const std::vector<double>& field,
                                  const std::vector<double>& polarization, const std::vector<double>& grid) {
  const double step = grid[1] - grid[0], start = cycle.turns.front().level;
  std::vector<double> sum(grid.size()), count(grid.size());
  for (std::size_t i = cycle.turns.front().leave; i <= cycle.last; ++i) {
    const double place = (field[i] - grid[0]) / step;
    if (!std::isfinite(place) || std::isnan(polarization[i]) || place < -0.5) continue;
    const auto k = static_cast<std::size_t>(std::lround(std::max(place, 0.)));
    if (k >= grid.size()) continue;
    sum[k] += polarization[i];
    ++count[k];
  }
  std::vector<double> out(grid.size(), NAN);
  std::size_t before = grid.size();
  for (std::size_t k = 0; k < grid.size(); ++k) {
    if (count[k] == 0) continue;
    out[k] = sum[k] / count[k];
    for (std::size_t gap = before + 1; before < k && gap < k; ++gap)
      out[gap] =
          std::lerp(out[before], out[k], static_cast<double>(gap - before) / static_cast<double>(k - before));
    before = k;
  }
  for (std::size_t k = 0; k < grid.size() && grid[k] < start - step / 2; ++k) out[k] = NAN;
  const double upper = before < grid.size() ? out[before] : NAN;
  for (auto& p : out) p -= upper;
  return out;
}

double density_at(const Forc& f, std::size_t row, std::size_t column) {
  const auto s = static_cast<std::ptrdiff_t>(f.smoothing);
  const auto least = static_cast<Eigen::Index>((f.smoothing + 1) * (f.smoothing + 1));
  const auto side = static_cast<Eigen::Index>(2 * f.smoothing + 1);
  Eigen::Matrix<double, Eigen::Dynamic, 6> terms(side * side, 6);
  Eigen::VectorXd values(side * side);
  Eigen::Index count = 0;
  const double x_unit = f.field[1] - f.field[0];
  const double y_unit = (f.reversal.back() - f.reversal.front()) / static_cast<double>(f.reversal.size() - 1);
  for (std::ptrdiff_t i = -s; i <= s; ++i)
    for (std::ptrdiff_t j = -s; j <= s; ++j) {
      const auto r = static_cast<std::ptrdiff_t>(row) + i, c = static_cast<std::ptrdiff_t>(column) + j;
      if (r < 0 || c < 0 || r >= std::ssize(f.reversal) || c >= std::ssize(f.field)) continue;
      const auto at = static_cast<std::size_t>(r), there = static_cast<std::size_t>(c);
      const double p = f.polarization[at][there];
      if (std::isnan(p)) continue;
      const double x = (f.field[there] - f.field[column]) / x_unit;
      const double y = (f.reversal[at] - f.reversal[row]) / y_unit;
      terms.row(count) << 1, x, y, x * x, y * y, x * y;
      values[count++] = p;
    }
  if (count < least) return NAN;
  const Eigen::VectorXd fitted = terms.topRows(count).colPivHouseholderQr().solve(values.head(count));
  return -fitted[5] / 2 / (x_unit * y_unit);
}

}  // namespace

std::optional<Forc> find_forc(const Recording& r, const std::vector<Cycle>& cycles, std::size_t smoothing) {
  if (!r.has(Channel::charge) || cycles.size() < least_curves || cycles.size() > most_curves ||
      !go_one_way(cycles))
    return std::nullopt;
  const auto p = polarization(r);
  const std::vector<double> values(p.values.begin(), p.values.end());
  auto ordered = cycles;
  std::ranges::sort(ordered, {}, &Cycle::low);
  Forc out{.reversal = {}, .field = {}, .polarization = {}, .density = {}, .smoothing = smoothing};
  const auto points = std::max<std::size_t>(ordered.size(), 2 * least_curves);
  for (std::size_t k = 0; k < points; ++k)
    out.field.push_back(std::lerp(ordered.front().low, ordered.front().high,
                                  static_cast<double>(k) / static_cast<double>(points - 1)));
  for (const auto& cycle : ordered) {
    out.reversal.push_back(cycle.low);
    out.polarization.push_back(rising_branch(cycle, field_of(r), values, out.field));
  }
  for (std::size_t row = 0; row < out.reversal.size(); ++row) {
    auto& densities = out.density.emplace_back(points, NAN);
    for (std::size_t column = 0; column < points; ++column)
      if (!std::isnan(out.polarization[row][column])) densities[column] = density_at(out, row, column);
  }
  return out;
}

}  // namespace ferrobench::recordings

#include "recordings/analysis/noise_colour.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "recordings/analysis/statistics.h"

namespace ferrobench::recordings {
namespace {

constexpr int window_rows = QuietWindows::length;
constexpr int lags = 24;
using Window = Eigen::Matrix<double, window_rows, 1>;
using Covariances = Eigen::Matrix<double, lags, 1>;
using Windows = std::vector<std::array<double, QuietWindows::length>>;

Eigen::Map<Window> vector_of(std::array<double, QuietWindows::length>& rows) {
  return Eigen::Map<Window>(rows.data());
}
Eigen::Map<const Window> vector_of(const std::array<double, QuietWindows::length>& rows) {
  return Eigen::Map<const Window>(rows.data());
}

const Eigen::Matrix<double, window_rows, window_rows>& detrending() {
  static const auto matrix = [] {
    Eigen::Matrix<double, window_rows, 5> basis;
    for (int i = 0; i < window_rows; ++i) {
      const double u = 2.0 * i / (window_rows - 1) - 1;
      basis.row(i) << 1, u, u * u, u * u * u, u * u * u * u;
    }
    const Eigen::Matrix<double, window_rows, window_rows> projection =
        basis * (basis.transpose() * basis).inverse() * basis.transpose();
    return Eigen::Matrix<double, window_rows, window_rows>(
        Eigen::Matrix<double, window_rows, window_rows>::Identity() - projection);
  }();
  return matrix;
}

Covariances covariances_of(const Window& e) {
  Covariances c;
  for (int k = 0; k < lags; ++k)
    c[k] = e.head(window_rows - k).dot(e.tail(window_rows - k)) / (window_rows - k);
  return c;
}

// What detrended windows of a process with correlation exp(-|i-j| / rows) show on average; rows = 0: white.
Covariances expected(double rows) {
  Eigen::Matrix<double, window_rows, window_rows> sigma;
  for (int i = 0; i < window_rows; ++i)
    for (int j = 0; j < window_rows; ++j)
      sigma(i, j) = rows > 0 ? std::exp(-std::abs(i - j) / rows) : (i == j ? 1.0 : 0.0);
  const Eigen::Matrix<double, window_rows, window_rows> seen = detrending() * sigma * detrending();
  Covariances c;
  for (int k = 0; k < lags; ++k) c[k] = seen.diagonal(k).mean();
  return c;
}

constexpr std::array<double, 7> correlation_rows{1.5, 2.5, 4, 6.5, 10, 16, 26};
const std::array<Covariances, 8>& expectations() {
  static const auto table = [] {
    std::array<Covariances, 8> out;
    out[0] = expected(0);
    for (std::size_t i = 0; i < correlation_rows.size(); ++i)
      out.at(i + 1) = expected(correlation_rows.at(i));
    return out;
  }();
  return table;
}

double second_differences(const Windows& windows) {
  double sum = 0;
  for (const auto& w : windows) {
    const auto e = vector_of(w);
    sum +=
        (e.head(window_rows - 2) - 2 * e.segment(1, window_rows - 2) + e.tail(window_rows - 2)).squaredNorm();
  }
  return sum;
}

// A tone that stands out of the windows' mean spectrum is taken out of each of them. By what factor their
// second differences, from which the noise's level comes, are too large with it.
double remove_tone(Windows& windows) {
  if (windows.size() < 4) return 1;
  constexpr int bins = window_rows / 2;
  std::vector<double> power(bins, 0.0);
  const auto wave = [](double frequency) {
    Eigen::Matrix<double, window_rows, 2> w;
    for (int i = 0; i < window_rows; ++i) {
      const double phase = 2 * std::numbers::pi * frequency * i;
      w.row(i) << std::cos(phase), std::sin(phase);
    }
    return w;
  };
  for (int b = 4; b < bins; ++b) {
    const auto w = wave(static_cast<double>(b) / window_rows);
    for (const auto& e : windows)
      power[static_cast<std::size_t>(b)] += (w.transpose() * vector_of(e)).squaredNorm();
  }
  const auto top = std::max_element(power.begin() + 4, power.end());
  if (*top < 6 * median({power.begin() + 4, power.end()})) return 1;
  const auto bin = static_cast<double>(top - power.begin());
  double best = 0, frequency = bin / window_rows;
  for (int k = -20; k <= 20; ++k) {
    const double f = (bin + 0.05 * k) / window_rows;
    const auto w = wave(f);
    double sum = 0;
    for (const auto& e : windows) sum += (w.transpose() * vector_of(e)).squaredNorm();
    if (sum > best) {
      best = sum;
      frequency = f;
    }
  }
  const auto w = wave(frequency);
  const Eigen::Matrix<double, 2, window_rows> solve = (w.transpose() * w).inverse() * w.transpose();
  const double with = second_differences(windows);
  for (auto& e : windows) vector_of(e) -= w * (solve * vector_of(e));
  return std::sqrt(with / second_differences(windows));
}

NoiseColour fitted(const Covariances& c, std::size_t windows) {
  const auto& table = expectations();
  const double white = c.dot(table[0]) / table[0].squaredNorm();
  const double uncertainty = c[0] / std::sqrt(static_cast<double>(windows) * window_rows);
  const double misfit = (c - white * table[0]).squaredNorm() / (uncertainty * uncertainty);
  if (misfit < 3.5 * lags) return {};
  NoiseColour best;
  double least = misfit;
  for (std::size_t i = 0; i < correlation_rows.size(); ++i) {
    Eigen::Matrix<double, lags, 2> basis;
    basis << table[0], table.at(i + 1);
    Eigen::Vector2d parts = (basis.transpose() * basis).ldlt().solve(basis.transpose() * c);
    if (parts[1] <= 0) continue;
    if (parts[0] < 0) parts = {0, c.dot(table.at(i + 1)) / table.at(i + 1).squaredNorm()};
    const double miss = (c - basis * parts).squaredNorm() / (uncertainty * uncertainty);
    if (miss < least) {
      least = miss;
      best = {parts[1] / (parts[0] + parts[1]), correlation_rows.at(i)};
    }
  }
  return least < 0.6 * misfit && best.slow_share > 0.2 ? best : NoiseColour{};
}

}  // namespace

double NoiseColour::covariance(double rows_apart) const {
  return slow_share * std::exp(-rows_apart / std::max(rows, 1e-9));
}

double NoiseColour::second_differences() const {
  return std::max(0.5, 6 - 8 * covariance(1) + 2 * covariance(2));
}

QuietWindows::QuietWindows(std::span<const double> time, std::span<const double> value, double scatter,
                           std::size_t most) {
  if (time.size() < length || !(scatter > 0)) return;
  const double usual = (time.back() - time.front()) / static_cast<double>(time.size() - 1);
  const std::size_t whole = time.size() / length, stride = 1 + (whole - 1) / most;
  for (std::size_t k = 0; k < whole; k += stride) {
    const auto from = k * length;
    const auto part = value.subspan(from, length);
    if (!(time[from + length - 1] - time[from] < 1.5 * usual * length) ||
        !std::ranges::all_of(part, [](double v) { return std::isfinite(v); }))
      continue;
    vector_of(windows_.emplace_back()).noalias() =
        detrending() * (Eigen::Map<const Window>(part.data()) / scatter);
  }
}

double QuietWindows::level() const {
  return std::sqrt(second_differences(windows_) / (6.0 * (window_rows - 2) * static_cast<double>(size())));
}

void keep_quiet(std::span<QuietWindows> channels) {
  std::vector<double> variances;
  for (const auto& c : channels)
    for (const auto& e : c.windows_) variances.push_back(vector_of(e).squaredNorm());
  if (variances.empty()) return;
  const auto third = variances.begin() + static_cast<std::ptrdiff_t>(variances.size() * 3 / 10);
  std::nth_element(variances.begin(), third, variances.end());
  const double most = 1.6 * *third;
  for (auto& c : channels) {
    std::erase_if(c.windows_, [&](const auto& e) { return vector_of(e).squaredNorm() > most; });
    c.tone_ = remove_tone(c.windows_);
  }
}

NoiseColour colour_of(std::span<const QuietWindows> channels) {
  constexpr std::size_t fewest = 8;
  Covariances sum = Covariances::Zero();
  std::size_t count = 0;
  for (const auto& c : channels) {
    for (const auto& e : c.windows_) sum += covariances_of(vector_of(e));
    count += c.size();
  }
  return count < fewest ? NoiseColour{} : fitted(sum / static_cast<double>(count), count);
}

}  // namespace ferrobench::recordings

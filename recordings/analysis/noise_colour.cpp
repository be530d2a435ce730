#include "recordings/analysis/noise_colour.h"

#include <Eigen/Dense>
#include <algorithm>
#include <boost/math/tools/minima.hpp>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>

#include "recordings/analysis/statistics.h"

namespace ferrobench::recordings {
namespace {

constexpr int window_rows = QuietWindows::length;
constexpr int lags = 24;
// The longest step of time in a window over its shortest. Clocks that count whole steps make two of one.
constexpr double most_uneven = 3;
// What a polynomial of the eighth degree leaves, over what it would leave of noise. Of simulated benches with
// noise of four to nine rows it was 0.98 to 1.00; of signals that a quartic does not follow 0.11 to 0.61, and
// of the displacement of a ceramic, whose noise is slow, 0.78.
constexpr double least_left = 0.7;
using Window = Eigen::VectorXd;
using Covariances = Eigen::VectorXd;
using Windows = std::vector<std::array<double, QuietWindows::length>>;

Eigen::Map<Window> vector_of(std::array<double, QuietWindows::length>& rows) {
  return {rows.data(), window_rows};
}
Eigen::Map<const Window> vector_of(const std::array<double, QuietWindows::length>& rows) {
  return {rows.data(), window_rows};
}

// An orthonormal basis of what the columns span.
Eigen::MatrixXd orthonormal(const Eigen::MatrixXd& columns) {
  return Eigen::HouseholderQR<Eigen::MatrixXd>(columns).householderQ() *
         Eigen::MatrixXd::Identity(columns.rows(), columns.cols());
}

// The matrix that takes out of a window its polynomial of so many powers.
Eigen::MatrixXd without_polynomial(int powers) {
  Eigen::MatrixXd columns(window_rows, powers);
  for (int i = 0; i < window_rows; ++i)
    for (int k = 0; k < powers; ++k) columns(i, k) = std::pow(2.0 * i / (window_rows - 1) - 1, k);
  const Eigen::MatrixXd basis = orthonormal(columns);
  return Eigen::MatrixXd::Identity(window_rows, window_rows) - basis * basis.transpose();
}
const Eigen::MatrixXd& detrending() {
  static const Eigen::MatrixXd matrix = without_polynomial(5);
  return matrix;
}
const Eigen::MatrixXd& detrending_farther() {
  static const Eigen::MatrixXd matrix = without_polynomial(9);
  return matrix;
}

Covariances covariances_of(const Window& e) {
  Covariances c(lags);
  for (int k = 0; k < lags; ++k)
    c[k] = e.head(window_rows - k).dot(e.tail(window_rows - k)) / (window_rows - k);
  return c;
}

// Of a process of variance 1 with correlation exp(-|i-j| / rows); rows = 0: white.
Eigen::MatrixXd covariance_matrix(double rows) {
  Eigen::MatrixXd out(window_rows, window_rows);
  for (int i = 0; i < window_rows; ++i)
    for (int j = 0; j < window_rows; ++j)
      out(i, j) = rows > 0 ? std::exp(-std::abs(i - j) / rows) : (i == j ? 1.0 : 0.0);
  return out;
}

// What detrended windows of it show on average.
Covariances expected(double rows) {
  const Eigen::MatrixXd seen = detrending() * covariance_matrix(rows) * detrending();
  Covariances c(lags);
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

double second_differences(const Window& e) {
  return (e.head(window_rows - 2) - 2 * e.segment(1, window_rows - 2) + e.tail(window_rows - 2))
      .squaredNorm();
}

// The standard deviation of white noise with such second differences.
double level_of(double second_differences) {
  return std::sqrt(second_differences / (6.0 * (window_rows - 2)));
}

// An orthonormal basis of the tones of so many periods in a window, detrended as the window is.
Eigen::MatrixXd tones(double periods) {
  Eigen::MatrixXd w(window_rows, 2);
  for (int i = 0; i < window_rows; ++i) {
    const double phase = 2 * std::numbers::pi * periods * i / window_rows;
    w.row(i) << std::cos(phase), std::sin(phase);
  }
  return orthonormal(detrending() * w);
}

// Of all windows, the squares that a tone takes, its amplitude and phase free in each.
double squares_of_tone(const Windows& windows, double periods) {
  const Eigen::MatrixXd basis = tones(periods);
  double out = 0;
  for (const auto& e : windows) out += (basis.transpose() * vector_of(e)).squaredNorm();
  return out;
}

// The sum of squares of a quiet window is at most 1.6 times what the quietest three tenths have.
double most_of_quiet(const Windows& windows) {
  if (windows.empty()) return 0;
  std::vector<double> squares;
  for (const auto& e : windows) squares.push_back(vector_of(e).squaredNorm());
  const auto third = squares.begin() + static_cast<std::ptrdiff_t>(squares.size() * 3 / 10);
  std::nth_element(squares.begin(), third, squares.end());
  return 1.6 * *third;
}

void erase_louder(Windows& windows, double most) {
  std::erase_if(windows, [most](const auto& e) { return vector_of(e).squaredNorm() > most; });
}

// The periods in a window of a tone that stands out of the windows' mean spectrum. Detrending takes what has
// fewer than four.
std::optional<double> find_tone(const Windows& windows) {
  constexpr int fewest_periods = 4, bins = window_rows / 2;
  // Times the median. Of 44 bins of white noise in four windows the largest is 2.6 times the median; in fewer
  // it comes too near.
  constexpr double stands_out = 6;
  constexpr std::size_t fewest_windows = 4;
  if (windows.size() < fewest_windows) return std::nullopt;
  std::vector<double> power;
  for (int b = fewest_periods; b < bins; ++b) power.push_back(squares_of_tone(windows, b));
  const auto top = std::ranges::max_element(power);
  // Between two bins a tone leaves a ninth of its power two bins away. What is broader is noise or signal.
  const auto at = top - power.begin();
  const auto falls = [&](std::ptrdiff_t bin) {
    return bin < 0 || bin >= std::ssize(power) || 3 * power[static_cast<std::size_t>(bin)] < *top;
  };
  if (*top < stands_out * median(power) || at == 0 || !falls(at - 2) || !falls(at + 2)) return std::nullopt;
  const double near = fewest_periods + static_cast<double>(at);
  constexpr double reach = 0.6;  // the tone is within half a bin of the one that it is largest in
  // To 1e-7: of a tone of a thousand times the noise a hundredth of the noise is left.
  constexpr int bits = 24;
  return boost::math::tools::brent_find_minima(
             [&](double periods) { return -squares_of_tone(windows, periods); }, near - reach,
             std::min(near + reach, bins - 0.1), bits)
      .first;
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
    Eigen::MatrixXd basis(lags, 2);
    basis << table[0], table.at(i + 1);
    Eigen::VectorXd parts = Eigen::HouseholderQR<Eigen::MatrixXd>(basis).solve(c);
    if (parts[1] <= 0) continue;
    if (parts[0] < 0) parts << 0, c.dot(table.at(i + 1)) / table.at(i + 1).squaredNorm();
    const double miss = (c - basis * parts).squaredNorm() / (uncertainty * uncertainty);
    if (miss < least) {
      least = miss;
      best = {parts[1] / (parts[0] + parts[1]), correlation_rows.at(i)};
    }
  }
  return least < 0.6 * misfit && best.slow_share > 0.2 ? best : NoiseColour{};
}

bool evenly_spaced(std::span<const double> time) {
  double shortest = std::numeric_limits<double>::infinity(), longest = 0;
  for (std::size_t i = 1; i < time.size(); ++i) {
    shortest = std::min(shortest, time[i] - time[i - 1]);
    longest = std::max(longest, time[i] - time[i - 1]);
  }
  return longest <= most_uneven * shortest;
}

// The share of noise of that colour that is left by a polynomial of the eighth degree, after one of the
// fourth.
double left_of_noise(const NoiseColour& colour) {
  const Eigen::MatrixXd sigma =
      colour.slow_share * covariance_matrix(colour.rows) + (1 - colour.slow_share) * covariance_matrix(0);
  return detrending_farther().cwiseProduct(sigma).sum() / detrending().cwiseProduct(sigma).sum();
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
        !evenly_spaced(time.subspan(from, length)) ||
        !std::ranges::all_of(part, [](double v) { return std::isfinite(v); }))
      continue;
    vector_of(windows_.emplace_back()).noalias() =
        detrending() * (Eigen::Map<const Window>(part.data(), window_rows) / scatter);
  }
}

double QuietWindows::level() const {
  if (windows_.empty()) return unit_;
  double sum = 0;
  for (const auto& e : windows_) sum += second_differences(vector_of(e));
  return unit_ * level_of(sum / static_cast<double>(size()));
}

// How loud a tone is beside the scatter, which comes from second differences, hangs on how often it was
// sampled. So each recording is asked by itself, before quiet windows of all are told from others.
void QuietWindows::remove_tone() {
  auto quiet = windows_;
  erase_louder(quiet, most_of_quiet(quiet));
  const auto periods = find_tone(quiet);
  if (!periods) return;
  const Eigen::MatrixXd basis = tones(*periods);
  std::vector<double> left;
  for (auto& e : windows_) {
    const Eigen::VectorXd along = basis.transpose() * vector_of(e);
    vector_of(e) -= basis * along;
    left.push_back(second_differences(vector_of(e)));
  }
  unit_ = level_of(median(left));
  for (auto& e : windows_) vector_of(e) /= unit_;
  has_tone_ = true;
}

void keep_quiet(std::span<QuietWindows> channels) {
  Windows all;
  for (auto& c : channels) {
    c.remove_tone();
    all.insert(all.end(), c.windows_.begin(), c.windows_.end());
  }
  const double most = most_of_quiet(all);
  for (auto& c : channels) erase_louder(c.windows_, most);
}

NoiseColour colour_of(std::span<const QuietWindows> channels) {
  constexpr std::size_t fewest = 8;
  Covariances sum = Covariances::Zero(lags);
  std::size_t count = 0;
  for (const auto& c : channels) {
    for (const auto& e : c.windows_) sum += covariances_of(vector_of(e));
    count += c.size();
  }
  if (count < fewest) return {};
  const auto out = fitted(sum / static_cast<double>(count), count);
  if (out.rows == 0) return out;
  double squares = 0, left = 0;
  for (const auto& c : channels)
    for (const auto& e : c.windows_) {
      squares += vector_of(e).squaredNorm();
      left += (detrending_farther() * vector_of(e)).squaredNorm();
    }
  return left < least_left * left_of_noise(out) * squares ? NoiseColour{.is_signal = true} : out;
}

}  // namespace ferrobench::recordings

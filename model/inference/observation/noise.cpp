#include "model/inference/observation/noise.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "recordings/analysis/statistics.h"

namespace ferrobench::model::inference {
namespace {

constexpr int window = 96;  // rows
constexpr int lags = 24;
// Less than this share of the range is below what any simulation resolves.
constexpr double smallest_noise = 2e-4;

using Window = Eigen::Matrix<double, window, 1>;
using Covariances = Eigen::Matrix<double, lags, 1>;

const Eigen::Matrix<double, window, window>& detrending() {
  static const auto matrix = [] {
    Eigen::Matrix<double, window, 5> basis;
    for (int i = 0; i < window; ++i) {
      const double u = 2.0 * i / (window - 1) - 1;
      basis.row(i) << 1, u, u * u, u * u * u, u * u * u * u;
    }
    const Eigen::Matrix<double, window, window> projection =
        basis * (basis.transpose() * basis).inverse() * basis.transpose();
    return Eigen::Matrix<double, window, window>(Eigen::Matrix<double, window, window>::Identity() -
                                                 projection);
  }();
  return matrix;
}

Covariances covariances_of(const Window& e) {
  Covariances c;
  for (int k = 0; k < lags; ++k) c[k] = e.head(window - k).dot(e.tail(window - k)) / (window - k);
  return c;
}

// What detrended windows of a process with correlation exp(-|i-j| / rows) show on average; rows = 0: white.
Covariances expected(double rows) {
  Eigen::Matrix<double, window, window> sigma;
  for (int i = 0; i < window; ++i)
    for (int j = 0; j < window; ++j)
      sigma(i, j) = rows > 0 ? std::exp(-std::abs(i - j) / rows) : (i == j ? 1.0 : 0.0);
  const Eigen::Matrix<double, window, window> seen = detrending() * sigma * detrending();
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

double second_differences(const std::vector<Window>& windows) {
  double sum = 0;
  for (const auto& e : windows)
    sum += (e.head(window - 2) - 2 * e.segment(1, window - 2) + e.tail(window - 2)).squaredNorm();
  return sum;
}

// A tone that stands out of the windows' mean spectrum is taken out of each of them. By what factor their
// second differences, from which the noise's level comes, are too large with it.
double remove_tone(std::vector<Window>& windows) {
  if (windows.size() < 4) return 1;
  constexpr int bins = window / 2;
  std::vector<double> power(bins, 0.0);
  const auto wave = [](double frequency) {
    Eigen::Matrix<double, window, 2> w;
    for (int i = 0; i < window; ++i) {
      const double phase = 2 * std::numbers::pi * frequency * i;
      w.row(i) << std::cos(phase), std::sin(phase);
    }
    return w;
  };
  for (int b = 4; b < bins; ++b) {
    const auto w = wave(static_cast<double>(b) / window);
    for (const auto& e : windows) power[static_cast<std::size_t>(b)] += (w.transpose() * e).squaredNorm();
  }
  const auto top = std::max_element(power.begin() + 4, power.end());
  if (*top < 6 * recordings::median({power.begin() + 4, power.end()})) return 1;
  const auto bin = static_cast<double>(top - power.begin());
  double best = 0, frequency = bin / window;
  for (int k = -20; k <= 20; ++k) {
    const double f = (bin + 0.05 * k) / window;
    const auto w = wave(f);
    double sum = 0;
    for (const auto& e : windows) sum += (w.transpose() * e).squaredNorm();
    if (sum > best) {
      best = sum;
      frequency = f;
    }
  }
  const auto w = wave(frequency);
  const Eigen::Matrix<double, 2, window> solve = (w.transpose() * w).inverse() * w.transpose();
  const double with = second_differences(windows);
  for (auto& e : windows) e -= w * (solve * e);
  return std::sqrt(with / second_differences(windows));
}

// Of unit variance in all; rows = 0 where nothing but white noise is seen.
struct Colour {
  double slow_share = 0, rows = 0;
  double r1() const { return slow_share * std::exp(-1 / std::max(rows, 1e-9)); }
  double r2() const { return slow_share * std::exp(-2 / std::max(rows, 1e-9)); }
};

Colour colour_of(const Covariances& c, std::size_t windows) {
  const auto& table = expectations();
  const double white = c.dot(table[0]) / table[0].squaredNorm();
  const double uncertainty = c[0] / std::sqrt(static_cast<double>(windows) * window);
  const double misfit = (c - white * table[0]).squaredNorm() / (uncertainty * uncertainty);
  if (misfit < 3.5 * lags) return {};
  Colour best;
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
  return least < 0.6 * misfit && best.slow_share > 0.2 ? best : Colour{};
}

struct Quiet {
  std::vector<Window> windows;  // detrended, over the scatter
  double tone = 1;              // the scatter is too large by this factor
  Covariances mean() const {
    Covariances c = Covariances::Zero();
    for (const auto& e : windows) c += covariances_of(e);
    return c / static_cast<double>(std::max<std::size_t>(1, windows.size()));
  }
};

}  // namespace

double NoiseModel::std() const {
  return std::hypot(white, slow);
}

std::vector<std::vector<NoiseModel>> estimate_noise(const std::vector<BenchRecording>& bench,
                                                    std::vector<std::string>& warnings) {
  std::vector<std::vector<NoiseModel>> out(bench.size());
  for (std::size_t r = 0; r < bench.size(); ++r) out[r].resize(bench[r].channels.size());
  for (const auto channel : compared_channels) {
    std::vector<Quiet> quiet(bench.size());
    std::vector<double> variances;
    for (std::size_t r = 0; r < bench.size(); ++r) {
      const auto* m = bench[r].find(channel);
      if (m == nullptr || m->scatter <= 0) continue;
      const auto& t = bench[r].time;
      const double usual = (t.back() - t.front()) / static_cast<double>(t.size() - 1);
      for (std::size_t i = 0; i + window <= t.size(); i += window) {
        Window e;
        bool whole = t[i + window - 1] - t[i] < 1.5 * usual * window;
        for (int k = 0; k < window; ++k) {
          e[k] = m->value[i + static_cast<std::size_t>(k)] / m->scatter;
          whole = whole && std::isfinite(e[k]);
        }
        if (!whole) continue;
        quiet[r].windows.emplace_back(detrending() * e);
        variances.push_back(quiet[r].windows.back().squaredNorm() / window);
      }
    }
    Quiet all;
    if (!variances.empty()) {
      const auto third = variances.begin() + static_cast<std::ptrdiff_t>(variances.size() * 3 / 10);
      std::nth_element(variances.begin(), third, variances.end());
      const double most = 1.6 * *third;
      for (auto& q : quiet) {
        std::erase_if(q.windows, [&](const Window& e) { return e.squaredNorm() / window > most; });
        q.tone = remove_tone(q.windows);
        all.windows.insert(all.windows.end(), q.windows.begin(), q.windows.end());
      }
    }
    const Colour pooled = all.windows.size() >= 8 ? colour_of(all.mean(), all.windows.size()) : Colour{};
    for (std::size_t r = 0; r < bench.size(); ++r) {
      for (std::size_t c = 0; c < bench[r].channels.size(); ++c) {
        const auto& m = bench[r].channels[c];
        if (m.channel != channel) continue;
        const auto& own = quiet[r].windows;
        Colour colour = pooled;
        if (pooled.rows > 0 && own.size() >= 12)
          if (const auto seen = colour_of(quiet[r].mean(), own.size()); seen.rows > 0) colour = seen;
        // Second differences of noise of this colour have 6 - 8 r1 + 2 r2 times its variance.
        const double level =
            m.scatter / quiet[r].tone * std::sqrt(6 / std::max(0.5, 6 - 8 * colour.r1() + 2 * colour.r2()));
        const double floor = smallest_noise * m.range;
        if (level < floor) {
          warnings.push_back(
              std::string(recordings::channel_name(channel)) + " of " + bench[r].name +
              " has less noise than simulations resolve; 0.02 % of its range is counted as noise.");
          colour = {};
        }
        const double total = std::max(level, floor);
        const auto& t = bench[r].time;
        auto& noise = out[r][c];
        noise.slow = total * std::sqrt(colour.slow_share);
        noise.white = total * std::sqrt(std::max(0.01, 1 - colour.slow_share));
        noise.correlation_time = colour.rows * (t.back() - t.front()) / static_cast<double>(t.size() - 1);
      }
    }
  }
  return out;
}

Whitening::Whitening(const NoiseModel& noise, std::span<const double> times) {
  if (noise.model_error > 0) {
    decay_.assign(times.size(), 0);
    gain_.assign(times.size(), 0);
    inverse_std_.assign(times.size(),
                        1 / (std::hypot(noise.std(), noise.model_error) * std::sqrt(noise.rows_as_one)));
    return;
  }
  const double slow = noise.slow * noise.slow, white = noise.white * noise.white;
  double variance = slow;
  for (std::size_t i = 0; i < times.size(); ++i) {
    const double a = i > 0 && slow > 0 ? std::exp(-(times[i] - times[i - 1]) / noise.correlation_time) : 0;
    const double before = i > 0 ? a * a * variance + slow * (1 - a * a) : slow;
    const double seen = before + white;
    decay_.push_back(a);
    gain_.push_back(before / seen);
    inverse_std_.push_back(1 / std::sqrt(seen));
    variance = before * white / seen;
  }
}

void Whitening::apply(std::span<double> values) const {
  double state = 0;
  for (std::size_t i = 0; i < values.size(); ++i) {
    const double predicted = decay_[i] * state, surprise = values[i] - predicted;
    state = predicted + gain_[i] * surprise;
    values[i] = surprise * inverse_std_[i];
  }
}

}  // namespace ferrobench::model::inference

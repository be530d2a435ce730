#include "model/inference/observation/noise.h"

#include <algorithm>
#include <cmath>

#include "recordings/analysis/noise_colour.h"

namespace ferrobench::model::inference {
namespace {

// By so much of the range (root mean square) two programs that solve the same equations differ once both are
// recalibrated to the same data. Of five benches with nothing hidden, played by 16,384 domains, 300 to 530 of
// the sum of squares were left, and 700 to an effect, which are 1.5e-5 to 2.1e-5; by 65,536 domains at most
// 160.
constexpr double between_programs = 2.5e-5;
// Quiet windows that a recording needs for a colour of its own.
constexpr std::size_t fewest_of_its_own = 12;

}  // namespace

double NoiseModel::std() const {
  return std::hypot(white, slow);
}

std::vector<std::vector<NoiseModel>> estimate_noise(const std::vector<BenchRecording>& bench,
                                                    std::vector<std::string>& warnings) {
  std::vector<std::vector<NoiseModel>> out(bench.size());
  for (std::size_t r = 0; r < bench.size(); ++r) out[r].resize(bench[r].channels.size());
  for (const auto channel : compared_channels) {
    std::vector<recordings::QuietWindows> quiet(bench.size());
    for (std::size_t r = 0; r < bench.size(); ++r)
      if (const auto* m = bench[r].find(channel); m != nullptr && m->scatter > 0) quiet[r] = m->quiet;
    recordings::keep_quiet(quiet);
    const auto pooled = recordings::colour_of(quiet);
    if (pooled.is_signal)
      warnings.push_back("The samples are too few to tell a memory of the noise from the signal of the " +
                         std::string(recordings::channel_name(channel)) +
                         ": its noise is taken to have none.");
    for (std::size_t r = 0; r < bench.size(); ++r) {
      for (std::size_t c = 0; c < bench[r].channels.size(); ++c) {
        const auto& m = bench[r].channels[c];
        if (m.channel != channel) continue;
        auto colour = pooled;
        if (pooled.rows > 0 && quiet[r].size() >= fewest_of_its_own)
          if (const auto seen = recordings::colour_of(std::span(&quiet[r], 1)); seen.rows > 0) colour = seen;
        const double without_tone = m.scatter * (quiet[r].has_tone() ? quiet[r].level() : 1);
        const double level = without_tone * std::sqrt(6 / colour.second_differences());
        const double floor = smallest_noise * m.range;
        if (level < floor) {
          warnings.push_back(
              std::string(recordings::channel_name(channel)) + " of " + bench[r].name +
              " has less noise than simulations resolve; 0.02 % of its range is counted as noise.");
          colour = {};
        }
        const double total = std::max(level, floor);
        auto& noise = out[r][c];
        noise.slow = total * std::sqrt(colour.slow_share);
        noise.white = total * std::sqrt(std::max(0.01, 1 - colour.slow_share));
        noise.correlation_time = colour.rows * bench[r].sampling_interval;
      }
    }
  }
  return out;
}

double squares_between_programs(const std::vector<BenchRecording>& bench,
                                const std::vector<std::vector<NoiseModel>>& noise,
                                std::span<const std::size_t> recordings) {
  double out = 0;
  for (const auto r : recordings)
    for (std::size_t c = 0; c < bench[r].channels.size(); ++c) {
      const auto& m = bench[r].channels[c];
      const auto measured = std::ranges::count_if(m.value, [](double v) { return !std::isnan(v); });
      out += static_cast<double>(measured) * std::pow(between_programs * m.range / noise[r][c].std(), 2);
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

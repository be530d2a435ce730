#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>

#include "model/discrepancy/misfit.h"

namespace ferrobench::model::discrepancy {

constexpr std::size_t most_aliases = 120;

std::vector<double> RecordingMisfit::tones(const Eigen::VectorXd& residual, const EffectParameter& range,
                                           std::size_t count) const {
  // In the longest recording, which resolves them best; all have a say afterwards.
  const Block* longest_block = nullptr;
  double longest = 0;
  for (const auto& b : blocks_) {
    const auto& r = bench_[b.recording];
    if (r.channels[b.channel].channel != recordings::Channel::displacement || b.count < 32) continue;
    if (r.duration() <= longest) continue;
    longest = r.duration();
    longest_block = &b;
  }
  if (longest_block == nullptr) return {};
  const Block& first = *longest_block;
  const auto& times = bench_[first.recording].time;
  const double step = 0.3 / longest;
  const auto bins = static_cast<std::size_t>(std::min(400000.0, (range.high - range.low) / step));
  std::vector<double> power(bins, 0.0);
  constexpr std::size_t together = 100;  // bins, between looks at whether to stop
  in_parallel(bins / together + 1, threads(), [&](std::size_t chunk) {
    check_stop(simulation());
    for (std::size_t b = chunk * together; b < std::min(bins, (chunk + 1) * together); ++b) {
      const double w = 2 * std::numbers::pi * (range.low + step * static_cast<double>(b));
      // Evenly sampled stretches need one rotation a sample.
      std::complex<double> wave = 1, turn = 1;
      double last_dt = -1, sum = 0, square = 0, last = times[first.rows[0]];
      wave = std::polar(1.0, w * last);
      for (std::size_t i = 0; i < first.rows.size(); ++i) {
        const double t = times[first.rows[i]], dt = t - last;
        if (dt > 0) {
          if (std::abs(dt - last_dt) > 1e-9 * dt) {
            turn = std::polar(1.0, w * dt);
            last_dt = dt;
          }
          wave *= turn;
          if (i % 64 == 0) wave = std::polar(1.0, w * t);
        }
        last = t;
        const double s = wave.imag();
        sum += s * residual[first.begin + static_cast<Eigen::Index>(i)];
        square += s * s;
      }
      power[b] = square > 1 ? sum * sum / square : 0;
    }
  });
  // Evenly sampled, a tone looks like any of its aliases; what tells them apart is that other recordings have
  // other intervals.
  std::vector<std::pair<double, double>> strongest;  // power in all recordings, frequency
  for (std::size_t k = 0; k < most_aliases; ++k) {
    const auto top = std::max_element(power.begin(), power.end());
    if (top == power.end() || *top <= 0) break;
    const auto at = top - power.begin();
    strongest.emplace_back(0, range.low + step * static_cast<double>(at));
    for (std::ptrdiff_t i = std::max<std::ptrdiff_t>(0, at - 4);
         i < std::min<std::ptrdiff_t>(at + 5, std::ssize(power)); ++i)
      power[static_cast<std::size_t>(i)] = 0;
  }
  in_parallel(strongest.size(), threads(), [&](std::size_t k) {
    const double w = 2 * std::numbers::pi * strongest[k].second;
    for (const auto& b : blocks_) {
      const auto& r = bench_[b.recording];
      if (r.channels[b.channel].channel != recordings::Channel::displacement) continue;
      double sum = 0, square = 0;
      for (std::size_t i = 0; i < b.rows.size(); ++i) {
        const double s = std::sin(w * r.time[b.rows[i]]);
        sum += s * residual[b.begin + static_cast<Eigen::Index>(i)];
        square += s * s;
      }
      if (square > 1) strongest[k].first += sum * sum / square;
    }
  });
  std::ranges::sort(strongest, std::greater<>());
  std::vector<double> out;
  for (std::size_t k = 0; k < std::min(count, strongest.size()); ++k) out.push_back(strongest[k].second);
  return out;
}

}  // namespace ferrobench::model::discrepancy

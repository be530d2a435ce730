#include "model/inference/observation/tones.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numbers>
#include <utility>

#include "model/inference/common/parallel.h"

namespace ferrobench::model::inference {
namespace {

constexpr std::size_t most_aliases = 120;  // frequencies that the longest series proposes
constexpr double most_bins = 400000;       // of its periodogram
constexpr Eigen::Index fewest_rows_of_a_tone = 32;

}  // namespace

std::vector<double> strongest_tones(const std::vector<ToneSeries>& series, std::pair<double, double> range,
                                    std::size_t count, int threads, const SimulationOptions& simulation) {
  // The longest recording resolves tones best, so it proposes; afterwards all recordings have a say.
  const ToneSeries* longest = nullptr;
  for (const auto& s : series)
    if (s.value.size() >= fewest_rows_of_a_tone && s.duration > (longest == nullptr ? 0 : longest->duration))
      longest = &s;
  if (longest == nullptr) return {};
  const auto [low, high] = range;
  const double step = 0.3 / longest->duration;
  const auto bins = static_cast<std::size_t>(std::min(most_bins, (high - low) / step));
  std::vector<double> power(bins, 0.0);
  // From bin to bin the phase of a row turns by an angle d of its own,
  //   sin(x + d) = 2 cos(d) sin(x) - sin(x - d).
  // Over so many bins, between looks at whether to stop, rounding adds up to 1e-8 of a sine at most.
  constexpr std::size_t together = 200;
  const Eigen::Map<const Eigen::ArrayXd> time(longest->time.data(), std::ssize(longest->time));
  const Eigen::ArrayXd turn = 2 * std::numbers::pi * step * time, twice_cosine = 2 * turn.cos();
  in_parallel(bins / together + 1, threads, [&, lowest = low](std::size_t chunk) {
    check_stop(simulation);
    const std::size_t first = chunk * together;
    const Eigen::ArrayXd phase = 2 * std::numbers::pi * (lowest + step * static_cast<double>(first)) * time;
    Eigen::ArrayXd sine = phase.sin(), last = (phase - turn).sin();
    for (std::size_t b = first; b < std::min(bins, first + together); ++b) {
      const double sum = sine.matrix().dot(longest->value), square = sine.matrix().squaredNorm();
      power[b] = square > 1 ? sum * sum / square : 0;
      last = twice_cosine * sine - last;
      std::swap(sine, last);
    }
  });
  // Evenly sampled, a tone looks like any of its aliases. What tells them apart is that other recordings have
  // other sampling intervals.
  std::vector<std::pair<double, double>> strongest;  // power in all recordings, frequency
  for (std::size_t k = 0; k < most_aliases; ++k) {
    const auto top = std::max_element(power.begin(), power.end());
    if (top == power.end() || *top <= 0) break;
    const auto at = top - power.begin();
    strongest.emplace_back(0, low + step * static_cast<double>(at));
    for (std::ptrdiff_t i = std::max<std::ptrdiff_t>(0, at - 4);
         i < std::min<std::ptrdiff_t>(at + 5, std::ssize(power)); ++i)
      power[static_cast<std::size_t>(i)] = 0;
  }
  in_parallel(strongest.size(), threads, [&](std::size_t k) {
    const double w = 2 * std::numbers::pi * strongest[k].second;
    for (const auto& s : series) {
      double sum = 0, square = 0;
      for (std::size_t i = 0; i < s.time.size(); ++i) {
        const double sine = std::sin(w * s.time[i]);
        sum += sine * s.value[static_cast<Eigen::Index>(i)];
        square += sine * sine;
      }
      if (square > 1) strongest[k].first += sum * sum / square;
    }
  });
  std::ranges::sort(strongest, std::greater<>());
  std::vector<double> out;
  for (std::size_t k = 0; k < std::min(count, strongest.size()); ++k) out.push_back(strongest[k].second);
  return out;
}

}  // namespace ferrobench::model::inference

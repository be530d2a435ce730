#include "recordings/analysis/uncertainty.h"

#include <algorithm>
#include <cmath>

namespace ferrobench::recordings {

Reading& Reading::operator+=(const Reading& other) {
  value += other.value;
  weights.insert(weights.end(), other.weights.begin(), other.weights.end());
  return *this;
}

Reading& Reading::operator*=(double factor) {
  value *= factor;
  for (auto& w : weights) w.weight *= factor;
  return *this;
}

Reading operator+(Reading a, const Reading& b) {
  return a += b;
}

Reading operator-(Reading a, Reading b) {
  return a += b *= -1;
}

Reading operator*(double factor, Reading a) {
  return a *= factor;
}

Reading abs(Reading a) {
  return a.value < 0 ? -1 * std::move(a) : a;
}

Noise::Noise(double deviation, const NoiseColour& colour, double lsb)
    : white_(deviation * deviation * (1 - colour.slow_share)) {
  constexpr double dithered = 0.5, widest_window = 50;
  if (colour.slow_share > 0) slow_.push_back({deviation * deviation * colour.slow_share, colour.rows});
  if (deviation < dithered * lsb) slow_.push_back({lsb * lsb / 12, widest_window});
}

// Of the exponential part each sample adds its weight times what the ones before have left of theirs.
double Noise::variance(std::vector<Weight> weights) const {
  std::ranges::sort(weights, {}, &Weight::sample);
  std::vector<Weight> merged;
  for (const auto& w : weights)
    if (!merged.empty() && merged.back().sample == w.sample) {
      merged.back().weight += w.weight;
    } else {
      merged.push_back(w);
    }
  double sum = 0;
  for (const auto& w : merged) sum += white_ * w.weight * w.weight;
  for (const auto& slow : slow_) {
    double before = 0;
    for (std::size_t i = 0; i < merged.size(); ++i) {
      const double w = merged[i].weight;
      if (i > 0)
        before *= std::exp(-static_cast<double>(merged[i].sample - merged[i - 1].sample) / slow.rows);
      sum += slow.variance * w * (w + 2 * before);
      before += w;
    }
  }
  return std::max(sum, 0.0);
}

double Noise::variance_of_mean(std::size_t samples) const {
  const auto n = static_cast<double>(samples);
  double out = white_ / n;
  for (const auto& slow : slow_) {
    // sum over i, j of r^|i - j| = n (1 + r) / (1 - r) - 2 r (1 - r^n) / (1 - r)^2
    const double r = std::exp(-1 / slow.rows);
    out +=
        slow.variance * ((1 + r) / (1 - r) / n - 2 * r * (1 - std::pow(r, n)) / ((1 - r) * (1 - r) * n * n));
  }
  return out;
}

double Noise::variance_of_sum(double squares) const {
  double each = white_;
  for (const auto& slow : slow_) each += slow.variance / std::tanh(0.5 / slow.rows);
  return each * squares;
}

}  // namespace ferrobench::recordings

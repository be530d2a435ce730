// How often a stated uncertainty covers the truth, and noise with a memory to ask it with.
#pragma once

#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <random>
#include <vector>

namespace ferrobench::daq {

// Of one figure, its errors in standard uncertainties.
struct Coverage {
  int figures = 0, covered = 0;
  double squares = 0, sum = 0;
  void take(double error_in_u) {
    ++figures;
    covered += std::abs(error_in_u) <= 2 ? 1 : 0;
    squares += error_in_u * error_in_u;
    sum += error_in_u;
  }
  double percent() const { return 100.0 * covered / figures; }
  double rms() const { return std::sqrt(squares / figures); }
};

// As a charge amplifier or an averaging readout shows it: two thirds of the variance over 4 samples.
inline void add_coloured(std::uint64_t seed, double deviation, std::vector<double>& values) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  const double decay = std::exp(-0.25), step = std::sqrt(1 - decay * decay);
  double slow = normal(random);
  for (double& v : values) {
    v += deviation * (std::sqrt(1.0 / 3) * normal(random) + std::sqrt(2.0 / 3) * slow);
    slow = decay * slow + step * normal(random);
  }
}

}  // namespace ferrobench::daq

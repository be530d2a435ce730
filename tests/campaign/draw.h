// Random numbers of a bench.
#pragma once

#include <cmath>
#include <random>

namespace ferrobench::campaign {

class Draw {
 public:
  explicit Draw(std::uint64_t seed) : generator(seed) {}
  double between(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(generator);
  }
  double decades(double low, double high) { return std::exp(between(std::log(low), std::log(high))); }
  bool chance(double probability) { return between(0, 1) < probability; }
  double sign() { return chance(0.5) ? 1 : -1; }
  double normal() { return std::normal_distribution<double>()(generator); }
  std::size_t below(std::size_t n) { return std::uniform_int_distribution<std::size_t>(0, n - 1)(generator); }

  std::mt19937_64 generator;
};

}  // namespace ferrobench::campaign

#include "daq/virtual/noise.h"

#include <bit>
#include <cmath>
#include <numbers>
#include <utility>

namespace ferrobench::daq {

namespace {

constexpr std::uint64_t golden = 0x9E3779B97F4A7C15;

// The finalizer of SplitMix64 (Steele, Lea, Flood 2014).
constexpr std::uint64_t mix(std::uint64_t x) {
  x = (x ^ (x >> 30)) * 0xBF58476D1CE4E5B9;
  x = (x ^ (x >> 27)) * 0x94D049BB133111EB;
  return x ^ (x >> 31);
}

// ln x for normal x > 0, to 1e-12, from the series of 2 artanh((m - 1) / (m + 1)) with m in [0.7, 1.42).
double log_of(double x) {
  constexpr std::uint64_t split = 0x3FE6A09E667F3BCD;  // sqrt(1/2)
  const auto bits = std::bit_cast<std::uint64_t>(x);
  const auto exponent = static_cast<std::int64_t>(bits - split) >> 52;
  const auto m = std::bit_cast<double>(bits - (static_cast<std::uint64_t>(exponent) << 52));
  const double z = (m - 1) / (m + 1);
  const double q = z * z;
  double sum = 1.0 / 15;
  for (int k = 13; k > 0; k -= 2) sum = sum * q + 1.0 / k;
  return 2 * z * sum + static_cast<double>(exponent) * std::numbers::ln2;
}

// sine and cosine of turns / 2^32 of a full turn, to 1e-11.
std::pair<double, double> sine_cosine(std::uint32_t turns) {
  const std::uint32_t quarter = (turns + (1U << 29)) >> 30;
  const double x = static_cast<std::int32_t>(turns - (quarter << 30)) * (2 * std::numbers::pi / 4294967296.0);
  const double q = x * x;
  const double s =
      x * (1 - q / 6 * (1 - q / 20 * (1 - q / 42 * (1 - q / 72 * (1 - q / 110 * (1 - q / 156))))));
  const double c = 1 - q / 2 * (1 - q / 12 * (1 - q / 30 * (1 - q / 56 * (1 - q / 90 * (1 - q / 132)))));
  switch (quarter & 3U) {
    case 0:
      return {s, c};
    case 1:
      return {c, -s};
    case 2:
      return {-s, -c};
    default:
      return {-c, s};
  }
}

// Two normal values (Box and Muller 1958).
std::pair<double, double> normals(std::uint64_t random) {
  const double uniform = (static_cast<double>(random >> 32) + 1) * (1 / 4294967296.0);
  const double radius = std::sqrt(-2 * log_of(uniform));
  const auto [s, c] = sine_cosine(static_cast<std::uint32_t>(random));
  return {radius * c, radius * s};
}

}  // namespace

Noise::Noise(std::uint64_t seed, std::uint64_t stream) : key_(mix(mix(seed + golden) + stream * golden)) {}

void Noise::add(std::uint64_t first, double std, std::span<double> values) const {
  if (std == 0) return;
  const auto pair = [this](std::uint64_t index) { return normals(mix(key_ + (index / 2 + 1) * golden)); };
  std::size_t i = 0;
  if (first % 2 == 1 && !values.empty()) values[i++] += std * pair(first).second;
  for (; i + 1 < values.size(); i += 2) {
    const auto [even, odd] = pair(first + i);
    values[i] += std * even;
    values[i + 1] += std * odd;
  }
  if (i < values.size()) values[i] += std * pair(first + i).first;
}

}  // namespace ferrobench::daq

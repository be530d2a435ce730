// White Gaussian noise that can be asked for at any place: the value depends on seed, stream and index alone,
// so it is the same however the rows are cut into blocks. Only operations that IEEE 754 rounds exactly are
// used, so it is also the same with any C library.
#pragma once

#include <cstdint>
#include <span>

namespace ferrobench::daq {

class Noise {
 public:
  // Streams of one seed (one per channel) are independent.
  Noise(std::uint64_t seed, std::uint64_t stream);
  // values[i] += std * z(first + i), with z standard normal.
  void add(std::uint64_t first, double std, std::span<double> values) const;

 private:
  std::uint64_t key_;
};

}  // namespace ferrobench::daq

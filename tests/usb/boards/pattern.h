// A board whose every conversion is another, known one, so that a sample that is lost, doubled or out of
// place shows, wherever in a long scan it is. It can start anywhere, for counts past 2^31.
#pragma once

#include "unit/board.h"

namespace ferrobench::emulator {

class PatternBoard final : public Board {
 public:
  explicit PatternBoard(std::uint64_t first = 0) : count_(first) {}

  // What the k-th conversion gives on the +-10 V range of a converter without errors. Neighbours differ much,
  // and the pattern does not repeat within 2^32 conversions at any period below 2^16.
  static std::uint16_t code(std::uint64_t k) {
    std::uint64_t x = k * 0x9E3779B97F4A7C15;
    x = (x ^ (x >> 29)) * 0xBF58476D1CE4E5B9;
    return static_cast<std::uint16_t>(x >> 48);
  }

  void output(Ticks /*time*/, unsigned channel, double volts) override {
    if (channel == 0) output_ = volts;
  }
  double input(Ticks /*time*/, const AnalogInput& /*input*/) override {
    return (static_cast<double>(code(count_++)) - 32768) * (10.0 / 32768);
  }
  std::uint64_t conversions() const { return count_; }
  double output_voltage() const { return output_; }

 private:
  std::uint64_t count_;
  double output_ = 0;
};

}  // namespace ferrobench::emulator

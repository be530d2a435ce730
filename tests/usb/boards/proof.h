// A board on which every sample proves its place: input 0 is looped back to output 0, inputs 1 to 3 show
// voltages that are known for each of their conversions, input 4 is a marker.
#pragma once

#include <array>
#include <vector>

#include "boards/pattern.h"

namespace ferrobench::emulator {

class ProofBoard final : public Board {
 public:
  static constexpr double marker_level = 9;   // V, no other input goes there
  static constexpr double pattern_reach = 8;  // V

  // What input 1, 2 or 3 shows at its k-th conversion since restart().
  static double pattern(std::uint64_t k, unsigned channel) {
    return (PatternBoard::code(4 * k + channel) - 32768) * (pattern_reach / 32768);
  }
  void restart() {
    conversions_.fill(0);
    times_.clear();
  }
  // When input 1 was converted, since restart(); kept only if asked for.
  const std::vector<Ticks>& times() const { return times_; }
  bool keep_times = false;

  void output(Ticks /*time*/, unsigned channel, double volts) override {
    if (channel == 0) output_ = volts;
  }
  double input(Ticks time, const AnalogInput& input) override {
    switch (input.channel) {
      case 0:
        return output_;
      case 4:
        return marker_level;
      case 1:
      case 2:
      case 3:
        if (keep_times && input.channel == 1) times_.push_back(time);
        return pattern(conversions_.at(input.channel)++, input.channel);
      default:
        return 0;
    }
  }

 private:
  double output_ = 0;
  std::array<std::uint64_t, 4> conversions_{};
  std::vector<Ticks> times_;
};

}  // namespace ferrobench::emulator

// Jumpers from analog outputs to analog inputs, and steady voltages for marker channels.
#pragma once

#include <array>
#include <optional>

#include "unit/board.h"

namespace ferrobench::emulator {

// volts = gain * (output's voltage, if any) + level
struct Jumper {
  std::optional<unsigned> output;
  double gain = 1;
  double level = 0;  // V
};

class LoopbackBoard final : public Board {
 public:
  std::array<Jumper, 16> jumpers;  // by input channel; as given: open inputs at 0 V
  std::uint8_t lines = 0;          // what the digital lines are held at from outside

  void output(Ticks /*time*/, unsigned channel, double volts) override { outputs_.at(channel) = volts; }
  double input(Ticks /*time*/, const AnalogInput& input) override {
    const Jumper& j = jumpers.at(input.channel);
    return (j.output ? j.gain * outputs_.at(*j.output) : 0) + j.level;
  }
  void digital_out(Ticks /*time*/, std::uint8_t levels, std::uint8_t driven) override {
    driven_ = driven;
    levels_ = levels;
  }
  std::uint8_t digital_in(Ticks /*time*/) override { return lines; }

  double output_voltage(unsigned channel) const { return outputs_.at(channel); }
  std::uint8_t driven() const { return driven_; }
  std::uint8_t levels() const { return levels_; }

 private:
  std::array<double, 2> outputs_{};
  std::uint8_t driven_ = 0, levels_ = 0;
};

}  // namespace ferrobench::emulator

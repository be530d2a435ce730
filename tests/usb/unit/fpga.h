// The FPGA's configuration (protocol note 8): empty after power-up, loaded by bytes, kept until power-off.
// Only their number is checked: the image itself belongs to the vendor and is not here.
#pragma once

#include <cstddef>
#include <cstdint>

namespace ferrobench::emulator {

class Fpga {
 public:
  Fpga(std::uint16_t product, bool configured);

  bool configured() const { return state_ == State::configured; }
  bool configuring() const { return state_ == State::configuring; }
  std::size_t image_size() const { return image_size_; }
  void power_up() { state_ = State::empty; }
  void begin();                                        // request 0x50 with its key
  bool take(std::size_t bytes, bool refuses = false);  // request 0x51; false: not in configuration mode

 private:
  enum class State { empty, configuring, configured };
  std::size_t image_size_;
  std::size_t received_ = 0;
  State state_;
};

}  // namespace ferrobench::emulator

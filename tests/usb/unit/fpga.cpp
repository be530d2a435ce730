#include "unit/fpga.h"

namespace ferrobench::emulator {

Fpga::Fpga(std::uint16_t product, bool configured)
    : image_size_(product >= 0x0134 ? 73722 : 73829), state_(configured ? State::configured : State::empty) {}

void Fpga::begin() {
  state_ = State::configuring;
  received_ = 0;
}

bool Fpga::take(std::size_t bytes, bool refuses) {
  if (state_ != State::configuring || bytes == 0 || bytes > 64) return false;
  received_ += bytes;
  if (received_ >= image_size_) state_ = refuses ? State::empty : State::configured;
  return true;
}

}  // namespace ferrobench::emulator

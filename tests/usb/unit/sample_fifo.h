// A bounded queue of 16-bit samples.
#pragma once

#include <array>
#include <cassert>
#include <cstddef>
#include <cstdint>

namespace ferrobench::emulator {

template <std::size_t Capacity>
class SampleFifo {
  static_assert((Capacity & (Capacity - 1)) == 0, "indices wrap by a mask");

 public:
  std::size_t size() const { return size_; }
  std::size_t room() const { return Capacity - size_; }
  void clear() { first_ = size_ = 0; }
  void push(std::uint16_t sample) {
    assert(size_ < Capacity);
    samples_[(first_ + size_++) & (Capacity - 1)] = sample;
  }
  std::uint16_t pop() {
    assert(size_ > 0);
    const std::uint16_t sample = samples_[first_];
    first_ = (first_ + 1) & (Capacity - 1);
    --size_;
    return sample;
  }

 private:
  std::array<std::uint16_t, Capacity> samples_{};
  std::size_t first_ = 0, size_ = 0;
};

}  // namespace ferrobench::emulator

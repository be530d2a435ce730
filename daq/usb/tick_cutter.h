// The byte stream of an input scan cut into ticks: one code of 16 bits for each input, tick after tick.
// Packets end where they like, within a tick or within a code.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace ferrobench::daq::usb {

class TickCutter {
 public:
  explicit TickCutter(std::size_t width) : width_(width) {}

  void reserve(std::size_t ticks) { codes_.reserve((ticks + 1) * width_); }
  void add(std::span<const std::byte> bytes);
  std::uint64_t received() const { return received_; }  // whole ticks since the start
  // Whole ticks that wait to be taken, their codes one after the other.
  std::span<const std::uint16_t> ticks() const;
  void drop(std::size_t ticks);

 private:
  std::size_t width_;
  std::uint64_t received_ = 0;
  std::vector<std::uint16_t> codes_;  // the last tick may be incomplete
  bool half_ = false;                 // a code's lower byte has come
  std::byte low_{};
};

}  // namespace ferrobench::daq::usb

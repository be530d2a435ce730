#include "daq/usb/tick_cutter.h"

#include "daq/usb/little_endian.h"

namespace ferrobench::daq::usb {

void TickCutter::add(std::span<const std::byte> bytes) {
  const std::size_t before = codes_.size() / width_;
  if (half_ && !bytes.empty()) {
    const std::byte both[] = {low_, bytes[0]};
    codes_.push_back(load_le<std::uint16_t>(both));
    bytes = bytes.subspan(1);
    half_ = false;
  }
  for (; bytes.size() >= 2; bytes = bytes.subspan(2)) codes_.push_back(load_le<std::uint16_t>(bytes));
  if (!bytes.empty()) {
    low_ = bytes[0];
    half_ = true;
  }
  received_ += codes_.size() / width_ - before;
}

std::span<const std::uint16_t> TickCutter::ticks() const {
  return std::span(codes_).first(codes_.size() / width_ * width_);
}

void TickCutter::drop(std::size_t ticks) {
  codes_.erase(codes_.begin(), codes_.begin() + static_cast<std::ptrdiff_t>(ticks * width_));
}

}  // namespace ferrobench::daq::usb

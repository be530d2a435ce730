// Numbers to and from the bytes of the wire, least significant byte first.
#pragma once

#include <bit>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace ferrobench::daq::usb {

template <std::unsigned_integral T>
T load_le(std::span<const std::byte> bytes) {
  T value = 0;
  for (std::size_t i = 0; i < sizeof(T); ++i)
    value = static_cast<T>(value | static_cast<T>(static_cast<T>(bytes[i]) << (8 * i)));
  return value;
}

template <std::unsigned_integral T>
void store_le(T value, std::span<std::byte> bytes) {
  for (std::size_t i = 0; i < sizeof(T); ++i) bytes[i] = static_cast<std::byte>(value >> (8 * i) & 0xFF);
}

template <std::unsigned_integral T>
void append_le(T value, std::vector<std::byte>& bytes) {
  bytes.resize(bytes.size() + sizeof(T));
  store_le(value, std::span(bytes).last(sizeof(T)));
}

inline float load_float(std::span<const std::byte> bytes) {
  return std::bit_cast<float>(load_le<std::uint32_t>(bytes));
}

}  // namespace ferrobench::daq::usb

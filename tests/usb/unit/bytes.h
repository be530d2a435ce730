// Little-endian fields in byte buffers. The caller has checked that they are there.
#pragma once

#include <cassert>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace ferrobench::emulator {

inline std::uint16_t get16(std::span<const std::byte> at) {
  assert(at.size() >= 2);
  return static_cast<std::uint16_t>(std::to_integer<unsigned>(at[0]) | std::to_integer<unsigned>(at[1]) << 8);
}
inline std::uint32_t get32(std::span<const std::byte> at) {
  return get16(at) | static_cast<std::uint32_t>(get16(at.subspan(2))) << 16;
}
inline void put16(std::span<std::byte> at, std::uint16_t value) {
  assert(at.size() >= 2);
  at[0] = static_cast<std::byte>(value & 0xFFU);
  at[1] = static_cast<std::byte>(value >> 8);
}
inline void put32(std::span<std::byte> at, std::uint32_t value) {
  put16(at, static_cast<std::uint16_t>(value & 0xFFFFU));
  put16(at.subspan(2), static_cast<std::uint16_t>(value >> 16));
}
inline void append16(std::vector<std::byte>& out, std::uint16_t value) {
  out.resize(out.size() + 2);
  put16(std::span(out).last(2), value);
}
inline void append32(std::vector<std::byte>& out, std::uint32_t value) {
  out.resize(out.size() + 4);
  put32(std::span(out).last(4), value);
}

}  // namespace ferrobench::emulator

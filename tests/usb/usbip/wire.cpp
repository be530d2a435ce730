#include "usbip/wire.h"

#include <algorithm>
#include <cassert>

namespace ferrobench::emulator::usbip {

namespace {

constexpr std::size_t setup_at = 40;

}  // namespace

Writer& Writer::u8(unsigned value) {
  out_.push_back(static_cast<std::byte>(value & 0xFFU));
  return *this;
}

Writer& Writer::u16(unsigned value) {
  return u8(value >> 8).u8(value);
}

Writer& Writer::u32(std::uint32_t value) {
  return u16(value >> 16).u16(value & 0xFFFFU);
}

Writer& Writer::text(std::string_view text, std::size_t size) {
  for (std::size_t i = 0; i < size; ++i) u8(i < text.size() ? static_cast<unsigned char>(text[i]) : 0);
  return *this;
}

Writer& Writer::bytes(std::span<const std::byte> bytes) {
  out_.insert(out_.end(), bytes.begin(), bytes.end());
  return *this;
}

std::uint16_t get16_big(std::span<const std::byte> at) {
  assert(at.size() >= 2);
  return static_cast<std::uint16_t>(std::to_integer<unsigned>(at[0]) << 8 | std::to_integer<unsigned>(at[1]));
}

std::uint32_t get32_big(std::span<const std::byte> at) {
  return static_cast<std::uint32_t>(get16_big(at)) << 16 | get16_big(at.subspan(2));
}

Header parse_header(std::span<const std::byte> bytes) {
  assert(bytes.size() >= header_size);
  const auto word = [&](std::size_t i) { return get32_big(bytes.subspan(4 * i)); };
  const auto setup = bytes.subspan(setup_at, header_size - setup_at);
  return {.command = word(0),
          .sequence = word(1),
          .device = word(2),
          .direction = word(3),
          .endpoint = word(4),
          .word = word(5),
          .length = word(6),
          .start_frame = word(7),
          .packets = word(8),
          .interval = word(9),
          .setup = std::vector(setup.begin(), setup.end())};
}

std::vector<std::byte> to_bytes(const Header& h) {
  Writer out;
  for (const std::uint32_t v : {h.command, h.sequence, h.device, h.direction, h.endpoint, h.word, h.length,
                                h.start_frame, h.packets, h.interval})
    out.u32(v);
  out.bytes(h.setup);
  auto bytes = out.take();
  bytes.resize(header_size);
  return bytes;
}

}  // namespace ferrobench::emulator::usbip

// USB/IP on the wire, version 1.1.1, as the kernel documents it (Documentation/usb/usbip_protocol.rst): every
// field big endian but the setup packet.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

namespace ferrobench::emulator::usbip {

inline constexpr std::uint16_t version = 0x0111;
inline constexpr std::uint16_t devlist_request = 0x8005, devlist_reply = 0x0005, import_request = 0x8003,
                               import_reply = 0x0003;
inline constexpr std::uint32_t submit = 1, unlink = 2, submit_reply = 3, unlink_reply = 4;
inline constexpr std::uint32_t direction_out = 0, direction_in = 1;
inline constexpr std::size_t op_header = 8, bus_id_size = 32, path_size = 256, header_size = 48;
inline constexpr std::uint32_t full_speed = 2, high_speed = 3;  // as the kernel numbers them

// A command's or answer's header: the words that both kinds of it have, and the eight bytes at its end.
struct Header {
  std::uint32_t command = 0, sequence = 0, device = 0, direction = 0, endpoint = 0;
  // submit: transfer_flags; unlink: sequence number to unlink; answers: status
  std::uint32_t word = 0;
  std::uint32_t length = 0;  // submit: transfer_buffer_length; its answer: actual_length
  std::uint32_t start_frame = 0, packets = 0, interval = 0;  // answers: error_count in the last
  std::vector<std::byte> setup;                              // 8
};

class Writer {
 public:
  Writer& u8(unsigned value);
  Writer& u16(unsigned value);
  Writer& u32(std::uint32_t value);
  Writer& text(std::string_view text, std::size_t size);  // filled up with zeros
  Writer& bytes(std::span<const std::byte> bytes);
  std::vector<std::byte> take() { return std::move(out_); }

 private:
  std::vector<std::byte> out_;
};

std::uint16_t get16_big(std::span<const std::byte> at);
std::uint32_t get32_big(std::span<const std::byte> at);
Header parse_header(std::span<const std::byte> bytes);  // header_size bytes
std::vector<std::byte> to_bytes(const Header& header);

}  // namespace ferrobench::emulator::usbip

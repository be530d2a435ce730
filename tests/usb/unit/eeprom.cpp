#include "unit/eeprom.h"

#include <algorithm>
#include <bit>

#include "unit/bytes.h"

namespace ferrobench::emulator {

namespace {

void put_line(std::span<std::byte> at, const CodeLine& line) {
  put32(at, std::bit_cast<std::uint32_t>(line.slope));
  put32(at.subspan(4), std::bit_cast<std::uint32_t>(line.offset));
}

// The only big-endian fields of the protocol.
void put_date(std::span<std::byte> at) {
  static constexpr std::array<std::uint16_t, 6> calibrated{2021, 3, 17, 9, 41, 5};
  for (std::size_t i = 0; i < calibrated.size(); ++i) {
    at[2 * i] = static_cast<std::byte>(calibrated[i] >> 8);
    at[2 * i + 1] = static_cast<std::byte>(calibrated[i] & 0xFFU);
  }
}

}  // namespace

Eeprom::Eeprom(const Calibration& calibration) {
  contents_.fill(std::byte{0xFF});
  const std::span all(contents_);
  for (std::size_t i = 0; i < calibration.input.size(); ++i)
    put_line(all.subspan(input_lines + 8 * i), calibration.input[i]);
  for (std::size_t i = 0; i < calibration.output.size(); ++i)
    put_line(all.subspan(output_lines + 8 * i), calibration.output[i]);
  put_date(all.subspan(input_date));
  put_date(all.subspan(output_date));
}

bool Eeprom::read(std::size_t length, std::vector<std::byte>& out) {
  if (length > most_bytes || address_ + length > size) return false;
  const auto begin = contents_.begin() + address_;
  out.assign(begin, begin + static_cast<std::ptrdiff_t>(length));
  address_ = static_cast<std::uint16_t>(address_ + length);
  return true;
}

bool Eeprom::write(std::span<const std::byte> data) {
  if (address_ == lock_address) {
    if (data.size() != 2) return false;
    unlocked_ = get16(data) == unlock_code;
    return true;
  }
  if (data.empty() || data.size() > most_bytes || address_ + data.size() > size) return false;
  const bool user = address_ >= user_begin && address_ + data.size() <= std::size_t{user_begin} + user_size;
  if (!user && !unlocked_) return false;
  std::copy(data.begin(), data.end(), contents_.begin() + address_);
  address_ = static_cast<std::uint16_t>(address_ + data.size());
  return true;
}

}  // namespace ferrobench::emulator

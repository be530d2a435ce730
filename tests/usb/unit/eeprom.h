// The EEPROM behind requests 0x30 and 0x31 (protocol note 7): calibration area behind a lock, user memory
// open.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "unit/calibration.h"

namespace ferrobench::emulator {

class Eeprom {
 public:
  static constexpr std::uint16_t size = 0x8000, input_lines = 0x7000, output_lines = 0x7080,
                                 input_date = 0x7098, output_date = 0x70A4, user_begin = 0x7410,
                                 user_size = 3048, lock_address = 0x8000, unlock_code = 0xAA55;
  static constexpr std::size_t most_bytes = 64;  // of one transfer

  explicit Eeprom(const Calibration& calibration);

  std::uint16_t address() const { return address_; }
  void set_address(std::uint16_t address) { address_ = address; }
  // From the address on, which moves along. False: outside, too long, or locked; nothing has changed then.
  bool read(std::size_t length, std::vector<std::byte>& out);
  bool write(std::span<const std::byte> data);
  void lock() { unlocked_ = false; }
  // The contents themselves, for a test that wants others.
  std::span<std::byte, size> contents() { return contents_; }

 private:
  std::array<std::byte, size> contents_;
  std::uint16_t address_ = 0;
  bool unlocked_ = false;
};

}  // namespace ferrobench::emulator

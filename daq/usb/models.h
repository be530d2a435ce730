// The products of the family, by what differs between them. Rates in Hz, FIFOs in samples of 16 bits.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

namespace ferrobench::daq::usb {

inline constexpr std::uint16_t vendor_id = 0x09DB;
inline constexpr double pacer_clock = 64e6;  // Hz, of every product here

struct ProductModel {
  std::uint16_t product = 0;
  std::string_view name{};
  bool driven = false;     // whether this driver speaks its protocol
  int outputs = 0;         // analog output channels, +-10 V
  double input_rate = 0;   // Hz, over all channels of a scan
  double output_rate = 0;  // Hz, on one channel
  std::size_t input_fifo = 0;
  std::size_t output_fifo = 0;
  std::size_t fpga_bytes = 0;
  std::string_view fpga_sha256{};  // lower-case hex
  std::string_view fpga_file{};    // its name where the vendor gives it away
};

std::span<const ProductModel> product_models();
// Null if there is none.
const ProductModel* find_model(std::uint16_t vendor, std::uint16_t product);

}  // namespace ferrobench::daq::usb

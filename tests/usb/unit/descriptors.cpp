#include "unit/descriptors.h"

#include "unit/bytes.h"
#include "unit/requests.h"

namespace ferrobench::emulator {

namespace {

constexpr std::uint8_t manufacturer_string = 1, product_string = 2, serial_string = 3;

std::vector<std::byte> bytes(std::initializer_list<unsigned> values) {
  std::vector<std::byte> out;
  for (const unsigned v : values) out.push_back(static_cast<std::byte>(v));
  return out;
}

std::vector<std::byte> text(std::string_view ascii) {
  std::vector<std::byte> out = bytes({static_cast<unsigned>(2 + 2 * ascii.size()), 3});
  for (const char c : ascii) append16(out, static_cast<unsigned char>(c));
  return out;
}

}  // namespace

std::vector<std::byte> device_descriptor(const UnitSetup& setup) {
  auto out = bytes({18, 1, 0x00, 0x02, 0xFF, 0, 0, 64});
  append16(out, vendor_id);
  append16(out, setup.product);
  append16(out, setup.firmware);
  const auto end = bytes({manufacturer_string, product_string, serial_string, 1});
  out.insert(out.end(), end.begin(), end.end());
  return out;
}

std::vector<std::byte> configuration_descriptor(const UnitSetup& setup) {
  constexpr unsigned bulk = 2;
  const auto packet = static_cast<unsigned>(setup.max_packet());
  const unsigned packet_low = packet & 0xFFU, packet_high = packet >> 8;
  // Configuration (bus-powered, 500 mA), interface 0 (vendor class), endpoints: AI first.
  return bytes({9,    2,          9 + 9 + 7 + 7,
                0,    1,          1,
                0,    0x80,       250,  //
                9,    4,          0,
                0,    2,          0xFF,
                0,    0,          0,  //
                7,    5,          input_endpoint,
                bulk, packet_low, packet_high,
                0,  //
                7,    5,          output_endpoint,
                bulk, packet_low, packet_high,
                0});
}

std::optional<std::vector<std::byte>> standard_in(const UnitSetup& setup, const Request& request) {
  switch (request.number) {
    case 0x00:  // GET_STATUS
      return bytes({0, 0});
    case 0x08:  // GET_CONFIGURATION
      return bytes({1});
    case 0x0A:  // GET_INTERFACE
      return bytes({0});
    case 0x06:  // GET_DESCRIPTOR
      break;
    default:
      return std::nullopt;
  }
  const unsigned index = request.value & 0xFFU;
  switch (request.value >> 8) {
    case 1:
      return device_descriptor(setup);
    case 2:
      if (index == 0) return configuration_descriptor(setup);
      return std::nullopt;
    case 3:
      if (index == 0) return bytes({4, 3, 0x09, 0x04});
      if (index == manufacturer_string) return text("emulated");
      if (index == product_string) return text("USB-1608GX-2AO");
      if (index == serial_string) return text(setup.serial);
      return std::nullopt;
    default:
      return std::nullopt;
  }
}

}  // namespace ferrobench::emulator

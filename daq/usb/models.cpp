#include "daq/usb/models.h"

#include <algorithm>
#include <array>

namespace ferrobench::daq::usb {

namespace {

// The two revisions of the board take different images.
constexpr ProductModel with_image(ProductModel model) {
  const bool newer = model.product >= 0x0134 && model.product <= 0x0136;
  model.fpga_bytes = newer ? 73722 : 73829;
  model.fpga_sha256 = newer ? "64381d544bebc892ee2292af5b35d421dde71ac4c3e09166d9dc11dc41c43b49"
                            : "d4d7868457ed8ec2523894b993a70bb66e8108747c799c384bb1e8ccd1e0c48f";
  model.fpga_file = newer ? "USB_1608G_2.rbf" : "USB_1608G.rbf";
  return model;
}

constexpr ProductModel g(std::uint16_t product) {
  return with_image(
      {.product = product, .name = "USB-1608G", .driven = true, .input_rate = 250e3, .input_fifo = 4096});
}

constexpr ProductModel gx(std::uint16_t product) {
  return with_image(
      {.product = product, .name = "USB-1608GX", .driven = true, .input_rate = 500e3, .input_fifo = 4096});
}

constexpr ProductModel gx_2ao(std::uint16_t product) {
  return with_image({.product = product,
                     .name = "USB-1608GX-2AO",
                     .driven = true,
                     .outputs = 2,
                     .input_rate = 500e3,
                     .output_rate = 500e3,
                     .input_fifo = 4096,
                     .output_fifo = 2048});
}

// Known by name, so that a user who plugs one in is told; its requests are not spoken here yet.
constexpr ProductModel usb_1808(std::uint16_t product, std::string_view name) {
  return {.product = product,
          .name = name,
          .fpga_bytes = 464196,
          .fpga_sha256 = "6c6f3336b2c390b3de96cdab94a9102b94364074a73f977a781378119129d0d2",
          .fpga_file = "USB_1808.bin"};
}

constexpr std::array models{gx_2ao(0x0112),
                            gx_2ao(0x0136),
                            g(0x0110),
                            g(0x0134),
                            gx(0x0111),
                            gx(0x0135),
                            usb_1808(0x013D, "USB-1808"),
                            usb_1808(0x013E, "USB-1808X")};

}  // namespace

std::span<const ProductModel> product_models() {
  return models;
}

const ProductModel* find_model(std::uint16_t vendor, std::uint16_t product) {
  if (vendor != vendor_id) return nullptr;
  const auto* found =
      std::find_if(models.begin(), models.end(), [&](auto& m) { return m.product == product; });
  return found == models.end() ? nullptr : found;
}

}  // namespace ferrobench::daq::usb

// The FPGA image: the unit wakes up without one, and does no acquisition until it has it. It is not ours to
// ship, so the configuration names a file, which is taken only if it is byte for byte the known one.
#pragma once

#include <functional>
#include <string>

#include "daq/usb/unit.h"

namespace ferrobench::daq::usb {

// Throws Error(io_error | invalid_params) that says where the image comes from.
std::vector<std::byte> read_fpga_image(const std::string& path, const ProductModel& model);

// Where an image comes from: the file by its name, for this product. Tests put their own in.
using ReadImage = std::function<std::vector<std::byte>(const std::string& path, const ProductModel& model)>;

// Nothing to do if the unit is configured already: it stays so until it loses power. True if it was loaded.
bool ensure_fpga(Unit& unit, const std::string& path, const ReadImage& read = read_fpga_image);

}  // namespace ferrobench::daq::usb

#include "daq/usb/fpga.h"

#include <span>

#include "base/sha256.h"
#include "base/text_file.h"

namespace ferrobench::daq::usb {

namespace {

std::string source_of(const ProductModel& model) {
  return "the image for this " + std::string(model.name) + " has " + std::to_string(model.fpga_bytes) +
         " bytes, SHA-256 " + std::string(model.fpga_sha256) + "; it is the file fpga/" +
         std::string(model.fpga_file) +
         " of the vendor's open-source library uldaq at its tag v1.1.2 (github.com/mccdaq/uldaq; later "
         "versions "
         "do not have the file any more); keep a copy and name it in fpga_image";
}

std::vector<std::byte> bytes_of(const std::string& path, const ProductModel& model) {
  constexpr std::size_t most_bytes = 1u << 26;  // of any file that could be taken for one
  try {
    const auto text = read_text_file(path, most_bytes, ErrorCode::invalid_params);
    const auto bytes = std::as_bytes(std::span(text));
    return {bytes.begin(), bytes.end()};
  } catch (const Error& error) {
    throw Error(ErrorCode::io_error, "the FPGA image cannot be read",
                Problem{.path = "/fpga_image",
                        .message = error.problems().empty() ? error.message() : error.problems()[0].message,
                        .given = path,
                        .hint = source_of(model)});
  }
}

}  // namespace

std::vector<std::byte> read_fpga_image(const std::string& path, const ProductModel& model) {
  if (path.empty())
    throw Error(ErrorCode::invalid_params, "the unit needs its FPGA image and the configuration names none",
                Problem{.path = "/fpga_image", .message = "is missing", .hint = source_of(model)});
  auto image = bytes_of(path, model);
  if (image.size() != model.fpga_bytes)
    throw Error(ErrorCode::invalid_params, "the file is not the FPGA image of this unit",
                Problem{.path = "/fpga_image",
                        .message = image.size() > model.fpga_bytes ? "is too long" : "is too short",
                        .given = path,
                        .allowed = model.fpga_bytes,
                        .unit = "bytes",
                        .hint = source_of(model)});
  if (const auto found = sha256_of(image); found != model.fpga_sha256)
    throw Error(ErrorCode::invalid_params, "the file is not the FPGA image of this unit",
                Problem{.path = "/fpga_image",
                        .message = "has another SHA-256",
                        .given = found,
                        .allowed = model.fpga_sha256,
                        .hint = source_of(model)});
  return image;
}

bool ensure_fpga(Unit& unit, const std::string& path, const ReadImage& read) {
  if (unit.status().fpga_configured()) return false;
  unit.load_fpga(read(path, unit.model()));
  if (!unit.status().fpga_configured())
    throw Error(ErrorCode::device_unavailable, "the unit did not accept its FPGA image",
                Problem{.path = "/fpga_image",
                        .given = path,
                        .hint = "unplug the unit, plug it in again and start again"});
  return true;
}

}  // namespace ferrobench::daq::usb

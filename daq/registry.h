// The kinds of device that this program knows, by name.
#pragma once

#include <memory>
#include <span>

#include "daq/device.h"

namespace ferrobench::daq {

struct DeviceKind {
  std::string_view name;
  std::string_view description;
  nlohmann::json (*schema)();  // JSON Schema of the configuration
  // Brings an output that is somewhere else to zero.
  std::unique_ptr<Device> (*open)(const nlohmann::json& config);
  bool keeps_output = false;  // when the program dies; info() has the "configuration" for open() then
};

std::span<const DeviceKind> device_kinds();
// `config` null or {}: the defaults. Throws Error(not_found) with the nearest name, and what the kind's
// open() throws.
std::unique_ptr<Device> open_device(std::string_view name, const nlohmann::json& config);

}  // namespace ferrobench::daq

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
  // Throws what open() throws of a configuration before it opens anything.
  void (*check)(const nlohmann::json& config);
  bool keeps_output = false;  // when the program dies; info() has the "configuration" for open() then
};

std::span<const DeviceKind> device_kinds();
// Throws Error(not_found) with the nearest name.
const DeviceKind& device_kind(std::string_view name);
// `config` null or {}: the defaults. Throws as device_kind() and the kind's open() do.
std::unique_ptr<Device> open_device(std::string_view name, const nlohmann::json& config);

}  // namespace ferrobench::daq

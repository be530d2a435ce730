#include "daq/registry.h"

#include "daq/replay/replay_device.h"
#include "daq/usb/config.h"
#include "daq/usb/usb_device.h"
#include "daq/virtual/virtual_device.h"

namespace ferrobench::daq {
namespace {

template <class Config>
nlohmann::json configuration_schema(const char* kind) {
  auto schema = json_schema<Config>();
  schema["$schema"] = "https://json-schema.org/draft/2020-12/schema";
  schema["$id"] = std::string("urn:ferrobench:device:") + kind + ":1";
  schema["title"] = std::string("ferrobench configuration of the device \"") + kind + "\"";
  return schema;
}

}  // namespace

std::span<const DeviceKind> device_kinds() {
  static constexpr std::array kinds{
      DeviceKind{.name = "virtual",
                 .description = "a specimen, amplifier and sensors computed by a model",
                 .schema = [] { return configuration_schema<VirtualConfig>("virtual"); },
                 .open = VirtualDevice::open,
                 .check = VirtualDevice::check},
      DeviceKind{.name = "usb",
                 .description = "a USB-1608GX-2AO with amplifier and sensors",
                 .schema = [] { return configuration_schema<usb::UsbConfig>("usb"); },
                 .open = usb::UsbDevice::open,
                 .check = [](const nlohmann::json& config) { usb::usb_config_from_json(config); },
                 .keeps_output = true},
      DeviceKind{.name = "replay",
                 .description = "a recording played again, as it was measured",
                 .schema = [] { return configuration_schema<ReplayConfig>("replay"); },
                 .open = ReplayDevice::open,
                 .check = [](const nlohmann::json& config) { replay_config_from_json(config); }},
  };
  return kinds;
}

const DeviceKind& device_kind(std::string_view name) {
  std::vector<std::string> names;
  for (const auto& kind : device_kinds()) {
    if (kind.name == name) return kind;
    names.emplace_back(kind.name);
  }
  const auto guess = nearest_name(name, names);
  throw Error(ErrorCode::not_found, "there is no such device",
              Problem{.path = "/device",
                      .message = "is no kind of device, and none that is open",
                      .given = name,
                      .allowed = names,
                      .hint = guess.empty() ? "" : "did you mean \"" + guess + "\"?"});
}

std::unique_ptr<Device> open_device(std::string_view name, const nlohmann::json& config) {
  return device_kind(name).open(config);
}

}  // namespace ferrobench::daq

#include "daq/registry.h"

#include "daq/replay/replay_device.h"
#include "daq/usb/config.h"
#include "daq/usb/usb_device.h"
#include "daq/virtual/virtual_device.h"

namespace ferrobench::daq {

std::span<const DeviceKind> device_kinds() {
  static constexpr std::array kinds{
      DeviceKind{.name = "virtual",
                 .description = "a specimen, amplifier and sensors computed by a model",
                 .schema = [] { return json_schema<VirtualConfig>(); },
                 .open = VirtualDevice::open},
      DeviceKind{.name = "usb",
                 .description = "a USB-1608GX-2AO with amplifier and sensors",
                 .schema = [] { return json_schema<usb::UsbConfig>(); },
                 .open = usb::UsbDevice::open,
                 .keeps_output = true},
      DeviceKind{.name = "replay",
                 .description = "a recording played again, as it was measured",
                 .schema = [] { return json_schema<ReplayConfig>(); },
                 .open = ReplayDevice::open},
  };
  return kinds;
}

std::unique_ptr<Device> open_device(std::string_view name, const nlohmann::json& config) {
  std::vector<std::string> names;
  for (const auto& kind : device_kinds()) {
    if (kind.name == name) return kind.open(config);
    names.emplace_back(kind.name);
  }
  const auto guess = nearest_name(name, names);
  throw Error(ErrorCode::not_found, "there is no such device",
              Problem{.path = "/device",
                      .given = name,
                      .allowed = names,
                      .hint = guess.empty() ? "" : "did you mean \"" + guess + "\"?"});
}

}  // namespace ferrobench::daq

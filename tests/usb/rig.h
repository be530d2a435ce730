// The driver on an emulated unit in one process, as fast as it can be computed.
#pragma once

#include <memory>

#include "boards/proof.h"
#include "daq/guard/guard.h"
#include "daq/usb/usb_device.h"
#include "host/device_clock.h"
#include "host/process_link.h"

namespace ferrobench::emulator {

// Output 0 to 20 V/V on layers of 100 um: 1 V of the unit is 2e5 V/m. Inputs in a tick: field, charge,
// displacement, force, marker.
inline nlohmann::json proof_config(daq::usb::StartMode start = daq::usb::StartMode::trigger) {
  return {{"amplifier",
           {{"gain", 20},
            {"voltage_min", -170},
            {"voltage_max", 170},
            {"monitor_ratio", 20},
            {"current_limit", 1},
            {"slew_limit", 1e5}}},
          {"specimen", {{"length", 0.02}, {"area", 25e-6}, {"layer_thickness", 1e-4}, {"capacitance", 1e-6}}},
          {"field", {{"channel", 0}}},
          {"charge", {{"channel", 1}, {"sensitivity", 1e5}}},
          {"displacement", {{"channel", 2}, {"sensitivity", 2e5}}},
          {"force", {{"channel", 3}, {"sensitivity", 0.02}}},
          {"marker", {{"channel", 4}, {"level", ProofBoard::marker_level}}},
          {"monitor_check", {{"tolerance", 2e4}}},
          {"start", {{"mode", start == daq::usb::StartMode::trigger ? "trigger" : "clock"}}}};
}
inline constexpr double field_of_volt = 2e5;  // V/m per V of the unit

// The unit's FPGA counts the bytes of its image and does not look at them.
inline std::vector<std::byte> blank_image(const std::string& /*path*/, const daq::usb::ProductModel& model) {
  return std::vector<std::byte>(model.fpga_bytes);
}

// DIO0 is jumpered to TRIG and the output's clock to the input's.
inline UnitSetup jumpered(UnitSetup setup = {}) {
  setup.wiring.trigger = TriggerSource::dio0;
  setup.wiring.input_clock = ClockSource::output_clock_out;
  return setup;
}

template <class BoardType>
struct Rig {
  explicit Rig(const nlohmann::json& json, BoardType& its_board, const UnitSetup& setup = jumpered())
      : config(daq::usb::usb_config_from_json(json)), board(its_board), unit(setup, its_board) {}

  daq::usb::UsbDevice& device() {
    if (!device_)
      device_ = std::make_unique<daq::usb::UsbDevice>(
          config,
          [this]() -> std::unique_ptr<daq::usb::Link> {
            if (!unit.on_bus()) throw Error(ErrorCode::device_unavailable, "no unit is attached");
            return std::make_unique<ProcessLink>(port, ::ferrobench::emulator::Pace::fast);
          },
          clock, blank_image);
    return *device_;
  }
  void close() { device_.reset(); }
  double output_volts() {
    clock.sleep_for(std::chrono::milliseconds(1));
    return unit.output_voltage(0);
  }

  daq::usb::UsbConfig config;
  BoardType& board;
  Unit unit;
  Port port{unit};
  DeviceClock clock{port};

 private:
  std::unique_ptr<daq::usb::UsbDevice> device_;
};

}  // namespace ferrobench::emulator

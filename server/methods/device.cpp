#include "daq/registry.h"
#include "daq/usb/units.h"
#include "server/methods/methods.h"

namespace ferrobench::server {
namespace {

struct DeviceKindRow {
  std::string name{}, description{};
  nlohmann::json config{};
};
template <class Visitor>
void describe(Visitor& visit, DeviceKindRow& r) {
  visit("name", r.name, {.required = true});
  visit("description", r.description, {});
  visit("config", r.config, {.doc = "JSON Schema of the configuration"});
}

struct DeviceList {
  std::vector<DeviceKindRow> kinds{};
  std::vector<std::string> open{};
  std::vector<daq::usb::UnitFound> usb{};
  std::string usb_problem{};
};
template <class Visitor>
void describe(Visitor& visit, DeviceList& l) {
  visit("kinds", l.kinds, {.required = true});
  visit("open", l.open, {.required = true, .doc = "ids of the devices that are open"});
  visit("usb", l.usb, {.doc = "units attached now"});
  visit("usb_problem", l.usb_problem, {.doc = "why USB cannot be looked at, \"\" if it can"});
}

struct OpenParams {
  std::string device = "virtual";
  nlohmann::json config = nlohmann::json::object();
};
template <class Visitor>
void describe(Visitor& visit, OpenParams& p) {
  visit("device", p.device, {.required = true, .doc = "a kind of device"});
  visit("config", p.config, {.doc = "as device.list describes it for this kind"});
}

struct DeviceParams {
  std::string device{};
};
template <class Visitor>
void describe(Visitor& visit, DeviceParams& p) {
  visit("device", p.device, {.required = true, .doc = "id of an open device"});
}

struct SelftestParams {
  std::string device{};
  double sample_rate = daq::selftest_rate;  // Hz
};
template <class Visitor>
void describe(Visitor& visit, SelftestParams& p) {
  visit("device", p.device, {.required = true, .doc = "id of an open device"});
  visit("sample_rate_Hz", p.sample_rate,
        {.unit = "Hz", .min = 0, .max = 1e9, .exclusive_min = true, .doc = "at which it is tested"});
}

struct DeviceInfo {
  std::string device{};
  nlohmann::json info{};
};
template <class Visitor>
void describe(Visitor& visit, DeviceInfo& d) {
  visit("device", d.device, {.required = true, .doc = "its id, for run.start"});
  visit("info", d.info, {.doc = "driver, serial number, ranges, rates"});
}

DeviceInfo opened(Engine& engine, const std::string& id) {
  DeviceInfo out{.device = id, .info = {}};
  engine.with_device(id, [&](const daq::DeviceFacts& device) { out.info = device.info; });
  return out;
}

}  // namespace

void add_device_methods(Dispatcher& rpc, Engine& engine) {
  rpc.add<NoParams>(
      {.name = "device.list", .doc = "The kinds of device there are, those open, and the units attached."},
      [&engine](const NoParams&) {
        DeviceList out{.kinds = {}, .open = engine.open_devices()};
        for (const auto& kind : daq::device_kinds())
          out.kinds.push_back({std::string(kind.name), std::string(kind.description), kind.schema()});
        try {
          out.usb = daq::usb::units();
        } catch (const Error& failure) {  // the list is as good without
          out.usb_problem = failure.what();
        }
        return out;
      });
  rpc.add<OpenParams>(
      {.name = "device.open",
       .doc = "Opens a device that keeps its state from run to run.",
       .role = Role::control,
       .errors = {ErrorCode::busy, ErrorCode::not_found, ErrorCode::bad_state, ErrorCode::bad_model,
                  ErrorCode::bad_recording, ErrorCode::device_unavailable, ErrorCode::device_lost,
                  ErrorCode::io_error, ErrorCode::limit_exceeded}},
      [&engine](const OpenParams& p) { return opened(engine, engine.open_device(p.device, p.config)); });
  rpc.add<DeviceParams>(
      {.name = "device.close",
       .doc = "Brings an open device's output to zero and closes it.",
       .role = Role::control,
       .errors = {ErrorCode::not_found, ErrorCode::busy, ErrorCode::bad_state, ErrorCode::device_lost}},
      [&engine](const DeviceParams& p) { engine.close_device(p.device); });
  rpc.add<DeviceParams>(
      {.name = "device.info",
       .doc = "What an open device says of itself.",
       .errors = {ErrorCode::not_found, ErrorCode::busy, ErrorCode::bad_state, ErrorCode::device_lost}},
      [&engine](const DeviceParams& p) { return opened(engine, p.device); });
  rpc.add<SelftestParams>(
      {.name = "device.selftest",
       .doc = "Plays a small waveform, with the output looped back to the field monitor, "
              "and compares. run.abort without a run's id stops it.",
       .role = Role::control,
       .lane = Lane::heavy,
       .errors = {ErrorCode::not_found, ErrorCode::busy, ErrorCode::bad_state, ErrorCode::cancelled,
                  ErrorCode::device_unavailable, ErrorCode::device_lost, ErrorCode::interlock_open,
                  ErrorCode::limit_exceeded}},
      [&engine](const SelftestParams& p) { return engine.selftest(p.device, p.sample_rate); });
}

}  // namespace ferrobench::server

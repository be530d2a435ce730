#include "server/engine/aftermath.h"

#include <algorithm>
#include <filesystem>
#include <set>

#include "base/fields.h"
#include "daq/not_at_zero.h"
#include "daq/registry.h"
#include "recordings/disk/new_file.h"
#include "recordings/file/reader.h"
#include "recordings/file/recover.h"

namespace ferrobench::server {

namespace {

using nlohmann::json;

// The device's configuration, if its output stays where it is when the program dies; else null.
json configuration_of(const json& device) {
  if (!device.is_object() || !device.contains("configuration")) return nullptr;
  const auto driver = text_at(device, "driver");
  const auto kinds = daq::device_kinds();
  const auto kind = std::ranges::find(kinds, driver, &daq::DeviceKind::name);
  if (kind == kinds.end() || !kind->keeps_output) return nullptr;
  auto out = device.at("configuration");
  // That very unit, whatever else is attached now.
  if (out.is_object() && device.contains("serial_number")) out["serial_number"] = device["serial_number"];
  return out;
}

void bring_to_zero(const std::vector<std::string>& broken, const Tell& tell) {
  std::set<std::pair<std::string, json>> seen;
  for (const auto& path : broken) {
    if (recordings::journal_state(path) != recordings::JournalState::left) continue;
    json device;
    try {
      device = recordings::read_summary(path).header.device;
    } catch (const Error&) {  // its recovery says what is wrong with it
      continue;
    }
    const auto configuration = configuration_of(device);
    if (configuration.is_null()) continue;
    const auto driver = device["driver"].get<std::string>();
    if (!seen.emplace(driver, configuration).second) continue;
    const auto unit = text_at(device, "serial_number");
    const auto what =
        driver + " unit " + unit + ", which run " + std::filesystem::path(path).stem().string() + " had";
    try {
      // Opening a device brings its output to zero.
      const auto opened = daq::open_device(driver, configuration);
      if (opened->output() != 0) throw Error(ErrorCode::device_lost, "it does not obey");
      tell(false, "output at zero: " + what, "");
    } catch (const std::exception& failure) {
      tell(true, daq::not_at_zero(what + ": " + failure.what()), unit);
    }
  }
}

}  // namespace

void put_right(const std::string& folder, const Tell& tell) {
  recordings::remove_leftovers(folder);
  const auto broken = recordings::find_broken(folder);
  bring_to_zero(broken, tell);
  for (const auto& path : broken) {
    const auto name = std::filesystem::path(path).filename().string();
    try {
      const auto done = recordings::recover_recording(path);
      tell(false, std::string(recovered_name(done.outcome)) + " " + name + ": " + done.message, "");
    } catch (const Error& error) {
      tell(true,
           name +
               " cannot be recovered, see 'ferrobench recover'; if its run had hardware, see that its "
               "output is at zero: " +
               error.what(),
           "");
    }
  }
}

}  // namespace ferrobench::server

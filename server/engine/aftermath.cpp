#include "server/engine/aftermath.h"

#include <filesystem>
#include <set>

#include "base/fields.h"
#include "daq/not_at_zero.h"
#include "recordings/disk/new_file.h"
#include "recordings/file/reader.h"
#include "recordings/file/recover.h"
#include "server/engine/benches.h"

namespace ferrobench::server {

namespace {

using nlohmann::json;

void bring_all_to_zero(const std::vector<std::string>& broken, const Tell& tell) {
  std::shared_ptr<BenchLink> bench;
  std::set<std::pair<std::string, json>> seen;
  for (const auto& path : broken) {
    if (recordings::journal_state(path) != recordings::JournalState::left) continue;
    json device;
    try {
      device = recordings::read_summary(path).header.device;
    } catch (const Error&) {  // its recovery says what is wrong with it
      continue;
    }
    const auto configuration = configuration_for_zero(device);
    if (configuration.is_null()) continue;
    const auto driver = device["driver"].get<std::string>();
    if (!seen.emplace(driver, configuration).second) continue;
    const auto unit = text_at(device, "serial_number");
    const auto what =
        driver + " unit " + unit + ", which run " + std::filesystem::path(path).stem().string() + " had";
    try {
      if (!bench) bench = BenchLink::to_process();
      bring_to_zero(bench, driver, configuration);
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
  bring_all_to_zero(broken, tell);
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

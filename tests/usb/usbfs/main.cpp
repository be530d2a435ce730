// ferrobench_usb_emulator [--config FILE] -- COMMAND ...
//
// ferrobench_usb_emulator [--config FILE] --device-config
//
// The first runs COMMAND with an emulated USB-1608GX-2AO on an emulated bus, which the unmodified libusb
// inside COMMAND finds. Needs umockdev-wrapper around it. SIGUSR1 pulls the unit's plug, SIGUSR2 puts it
// back. COMMAND finds this process's number in FERROBENCH_USB_EMULATOR. Ends with COMMAND's exit code. The
// second prints the configuration of a device on the emulated bench, for ferrobench run --device usb
// --device-config.
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <iostream>
#include <map>
#include <mutex>
#include <thread>

#include "host/emulator.h"
#include "usbfs/testbed.h"
#include "usbfs/usbfs.h"

extern char** environ;

namespace ferrobench::emulator {
namespace {

// From a reset request to being on the bus again.
constexpr std::chrono::milliseconds reset_time{200};

volatile std::sig_atomic_t unplug_asked = 0, plug_asked = 0;

nlohmann::json configuration(const std::string& path) {
  std::ifstream file(path);
  if (!file) throw std::runtime_error("cannot read " + path + ": give a JSON file after --config");
  return nlohmann::json::parse(file);
}

int run(const nlohmann::json& json, char** command) {
  Emulator emulator(emulator_config_from_json(json));
  std::mutex mutex;
  std::map<std::string, Usbfs> nodes;
  Usbfs* usbfs = nullptr;  // of the latest node
  Testbed* bed = nullptr;
  Testbed testbed(
      [&](const std::string& node, std::uint64_t client, unsigned long request, UMockdevIoctlData& arg) {
        const std::scoped_lock lock(mutex);
        emulator.keep_up();
        const int result = nodes.at(node).ioctl(client, request, arg);
        usbfs->collect();
        bed->set_reapable(usbfs->reapable());
        return result;
      });
  bed = &testbed;
  const auto plug = [&] {
    testbed.plug(emulator.unit().setup());
    usbfs = &nodes.try_emplace(testbed.node(), emulator.port()).first->second;
  };
  {
    const std::scoped_lock lock(mutex);
    plug();
  }
  std::signal(SIGUSR1, [](int) { unplug_asked = 1; });
  std::signal(SIGUSR2, [](int) { plug_asked = 1; });
  setenv("FERROBENCH_USB_EMULATOR", std::to_string(getpid()).c_str(), 1);

  pid_t child = 0;
  if (const int error = posix_spawnp(&child, command[0], nullptr, nullptr, command, environ); error != 0)
    throw std::system_error(error, std::generic_category(), command[0]);
  bool on_bus = true;
  constexpr auto never_back = std::chrono::steady_clock::time_point::max();
  auto back = never_back;  // from a reset
  int status = 0;
  while (waitpid(child, &status, WNOHANG) == 0) {
    {
      const std::scoped_lock lock(mutex);
      Unit& unit = emulator.unit();
      if (std::exchange(unplug_asked, 0) != 0) unit.unplug();
      if (usbfs->take_reset()) back = std::chrono::steady_clock::now() + reset_time;
      const bool again = std::chrono::steady_clock::now() >= back;
      if (again) back = never_back;
      if (again || std::exchange(plug_asked, 0) != 0) unit.plug();
      emulator.keep_up();
      usbfs->collect();
      testbed.set_reapable(usbfs->reapable());
      if (on_bus && !unit.on_bus()) {
        testbed.unplug();
        usbfs->retire();
      }
      if (!on_bus && unit.on_bus()) plug();
      on_bus = unit.on_bus();
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
}

}  // namespace
}  // namespace ferrobench::emulator

int main(int argc, char** argv) {
  int at = 1;
  nlohmann::json json;
  try {
    if (at + 1 < argc && std::string_view(argv[at]) == "--config") {
      json = ferrobench::emulator::configuration(argv[at + 1]);
      at += 2;
    }
    if (at < argc && std::string_view(argv[at]) == "--device-config") {
      const auto config = ferrobench::emulator::emulator_config_from_json(json);
      std::cout << ferrobench::emulator::device_config(config.bench).dump(2) << '\n';
      return 0;
    }
    if (at < argc && std::string_view(argv[at]) == "--") ++at;
    if (at >= argc) {
      std::cerr << "usage: umockdev-wrapper ferrobench_usb_emulator [--config FILE] -- COMMAND ...\n"
                   "       ferrobench_usb_emulator [--config FILE] --device-config\n";
      return 2;
    }
    return ferrobench::emulator::run(json, argv + at);
  } catch (const std::exception& error) {
    std::cerr << "ferrobench_usb_emulator: " << error.what() << '\n';
    return 2;
  }
}

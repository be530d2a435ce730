// ferrobench_usbip_emulator [--config FILE] [--port N]
//
// Offers an emulated USB-1608GX-2AO over USB/IP on loopback. On a machine with vhci-hcd, or in a guest that
// forwards the port:  modprobe vhci-hcd && usbip attach -r 127.0.0.1 -b 1-1
#include <csignal>
#include <cstdlib>
#include <fstream>
#include <iostream>

#include "usbip/server.h"

namespace {

ferrobench::emulator::usbip::Server* serving = nullptr;

int run(std::span<char*> arguments) {
  using namespace ferrobench::emulator;
  constexpr std::uint16_t usual_port = 3240;
  nlohmann::json json;
  unsigned long port = usual_port;
  for (std::size_t i = 1; i < arguments.size(); i += 2) {
    const std::string_view option = arguments[i];
    if (i + 1 == arguments.size() || (option != "--config" && option != "--port")) {
      std::cerr << "usage: ferrobench_usbip_emulator [--config FILE] [--port N]\n";
      return 2;
    }
    if (option == "--port") {
      port = std::strtoul(arguments[i + 1], nullptr, 10);
      if (port > 65535) throw std::runtime_error("--port: 0 to 65535 are ports");
    } else {
      std::ifstream file(arguments[i + 1]);
      if (!file) throw std::runtime_error(std::string("cannot read ") + arguments[i + 1]);
      json = nlohmann::json::parse(file);
    }
  }
  Emulator emulator(emulator_config_from_json(json));
  usbip::Server server(emulator, static_cast<std::uint16_t>(port));
  serving = &server;
  std::signal(SIGINT, [](int) { serving->stop(); });
  std::signal(SIGTERM, [](int) { serving->stop(); });
  std::cout << "listening on 127.0.0.1:" << server.port() << std::endl;
  server.run();
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    return run(std::span(argv, static_cast<std::size_t>(argc)));
  } catch (const std::exception& error) {
    std::cerr << "ferrobench_usbip_emulator: " << error.what() << '\n';
    return 2;
  }
}

// umockdev-wrapper ferrobench_usb_emulator --config FILE -- ferrobench_usb_throughput [--seconds N]
//
// A run at 500 kS/s in (4 channels) and 125 kS/s out through libusb into a recording, with board "proof"
// behind the unit. Prints what driver, guard and writer took of one core, how the memory grew, and whether
// every sample in the recording is the one that was taken there. Exit code 1 if one is not.
#include <sys/resource.h>
#include <unistd.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <thread>

#include "daq/registry.h"
#include "recordings/file/reader.h"
#include "rig.h"
#include "server/engine/live.h"
#include "server/engine/run.h"

namespace ferrobench::emulator {
namespace {

namespace fs = std::filesystem;
using recordings::Channel;

constexpr double rate = 125e3;  // rows/s

double cpu_seconds() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_utime.tv_sec + usage.ru_stime.tv_sec) +
         1e-6 * static_cast<double>(usage.ru_utime.tv_usec + usage.ru_stime.tv_usec);
}

double resident_mib() {
  std::ifstream file("/proc/self/statm");
  double size = 0, resident = 0;
  file >> size >> resident;
  return resident * static_cast<double>(sysconf(_SC_PAGESIZE)) / (1 << 20);
}

// 500 kS/s are four inputs: field, charge, displacement, force. The monitor's check takes the marker's place.
nlohmann::json configuration() {
  auto config = proof_config();
  config.erase("marker");
  config["queue_ahead"] = 0.5;
  return config;
}

nlohmann::json protocol(double seconds) {
  return {{"format", "ferrobench-protocol"},
          {"version", 1},
          {"name", "throughput"},
          {"unit", "kV/mm"},
          {"start", 0},
          {"sample_rate_Hz", rate},
          {"segments",
           {{{"kind", "triangle"},
             {"low", 0},
             {"high", 1},
             {"rate", 20},
             {"cycles", static_cast<int>(std::ceil(seconds * 10))},
             {"first", "up"}}}}};
}

std::string check(const recordings::Recording& r) {
  constexpr std::array channels{Channel::charge, Channel::displacement, Channel::force};
  constexpr std::array sensitivity{1e5, 2e5, 0.02};
  for (std::size_t row = 0; row < r.size(); ++row) {
    for (unsigned c = 0; c < channels.size(); ++c)
      if (!(std::abs(r.at(channels.at(c))[row] * sensitivity.at(c) - ProofBoard::pattern(row, c + 1)) <
            0.25e-3))
        return "row " + std::to_string(row) + " is wrong";
    // 160 V/m from tick to tick.
    if (!(std::abs(r.at(Channel::field)[row] - r.at(Channel::command)[row]) < 100))
      return "row " + std::to_string(row) + " has another field than was asked for";
  }
  return {};
}

int measure(double seconds) {
  const auto folder = fs::temp_directory_path() / ("fb-throughput-" + std::to_string(getpid()));
  fs::create_directories(folder);
  const server::Store store(folder);
  const auto plan =
      server::make_plan({.protocol = protocol(seconds), .device = "usb", .config = configuration()}, store);
  const auto device = std::make_shared<server::HeldDevice>(daq::open_device("usb", plan.device_config));
  server::Hub nobody;
  nobody.add_topic({.name = "run", .doc = ""});
  nobody.add_topic({.name = "events", .doc = ""});
  nobody.add_topic(server::samples_topic());
  daq::Limits limits;
  limits.slew = 1e9;
  const double cpu = cpu_seconds();
  const auto begin = std::chrono::steady_clock::now();
  const auto passed = [&] {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  };
  server::Run run({.id = "throughput",
                   .plan = plan,
                   .device = device,
                   .device_name = "usb",
                   .limits = limits,
                   .path = folder / "throughput.h5"},
                  nobody);
  run.begin();
  double first = 0;
  while (!run.over()) {
    if (first == 0 && passed() > seconds / 4) first = resident_mib();
    if (first > 0) std::fprintf(stderr, "%5.1f s, %6.1f MiB\r", passed(), resident_mib());
    std::this_thread::sleep_for(std::chrono::milliseconds(500));
  }
  const double last = resident_mib(), took = passed(), used = cpu_seconds() - cpu;
  run.wait();
  const auto status = run.status();
  std::printf(
      "%lld rows of 4 in %.1f s: %.1f %% of one core, memory %.1f MiB at a quarter and %.1f MiB at the end\n",
      static_cast<long long>(status.rows), took, 100 * used / took, first, last);
  if (status.state != server::RunState::complete)
    std::printf("the run was aborted: %s\n", status.reason.c_str());
  const auto recording = recordings::read_recording(status.path);
  const auto wrong = check(recording);
  std::printf("%zu rows recorded, %s\n", recording.size(),
              wrong.empty() ? "each the right one" : wrong.c_str());
  fs::remove_all(folder);
  const bool good = status.state == server::RunState::complete && wrong.empty() &&
                    static_cast<std::int64_t>(recording.size()) == status.rows;
  return good ? EXIT_SUCCESS : EXIT_FAILURE;
}

}  // namespace
}  // namespace ferrobench::emulator

int main(int argc, char** argv) {
  const bool given = argc == 3 && std::strcmp(argv[1], "--seconds") == 0;
  try {
    return ferrobench::emulator::measure(given ? std::atof(argv[2]) : 60);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "ferrobench_usb_throughput: %s\n", error.what());
    return 2;
  }
}

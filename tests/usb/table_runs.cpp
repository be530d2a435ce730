// ferrobench_usb_table_runs TABLE [--seed N] [--update-rate HZ]: a published table's experiments through USB,
// on virtual benches behind emulated units, beside the same on the virtual device with other noise. Exit code
// 1 if they are further apart than noise allows.
#include "server/engine/table_runs.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>

#include "boards/virtual_bench.h"
#include "recordings/file/reader.h"
#include "recordings/tables/comparison.h"
#include "rig.h"
#include "server/engine/live.h"
#include "server/engine/run.h"

namespace ferrobench::emulator {
namespace {

namespace fs = std::filesystem;

struct Folder {
  Folder() {
    auto name = (fs::temp_directory_path() / "ferrobench-usb-XXXXXX").string();
    if (mkdtemp(name.data()) == nullptr) throw std::runtime_error("no temporary folder can be made: " + name);
    path = name;
  }
  ~Folder() {
    std::error_code ignored;
    fs::remove_all(path, ignored);
  }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;
  fs::path path;
};

recordings::Recording through_usb(const server::RunRequest& request, const server::Store& store,
                                  const fs::path& file, double update_rate) {
  const auto direct = server::make_plan(request, store);
  BenchConfig bench;
  bench.specimen = daq::virtual_config_from_json(direct.device_config);
  bench.fresh = true;
  VirtualBench board(bench);
  auto usb = request;
  usb.device = "usb";
  usb.model = nullptr;
  usb.fast = false;
  usb.config = device_config(bench);
  usb.config["update_rate"] = update_rate;
  auto plan = server::make_plan(usb, store);
  Rig rig(plan.device_config, board);

  server::Hub nobody;
  nobody.add_topic({.name = "run", .doc = ""});
  nobody.add_topic({.name = "events", .doc = ""});
  nobody.add_topic(server::samples_topic());
  server::Run run({.id = file.filename(),
                   .plan = std::move(plan),
                   .device = std::make_shared<server::HeldDevice>(
                       std::shared_ptr<daq::Device>(std::shared_ptr<void>(), &rig.device())),
                   .device_name = "usb",
                   .limits = {},
                   .path = file,
                   .real_time = false},
                  nobody);
  run.begin();
  run.wait();
  const auto status = run.status();
  if (status.state != server::RunState::complete || !status.output_at_zero)
    throw std::runtime_error("the run through USB was aborted: " + status.reason);
  return recordings::read_recording(status.path);
}

// A program that does not start at zero waits at its first level for the unit to be armed, which the virtual
// device is at once, and the specimen creeps. A long rest there makes the two alike.
std::vector<server::RunRequest> rested_requests(const std::string& table, std::int64_t seed) {
  auto requests = server::table_requests(table, nullptr, nlohmann::json::object(), seed);
  for (auto& request : requests) {
    request.protocol = protocols::library_protocol(request.protocol.get<std::string>()).json();
    if (request.protocol.value("start", 0.0) == 0) continue;
    auto& segments = request.protocol["segments"];
    segments.insert(segments.begin(), nlohmann::json{{"kind", "hold"}, {"time", 5}});
  }
  return requests;
}

int run(const std::string& table, std::int64_t seed, double update_rate) {
  const Folder folder;
  const server::Store store(folder.path);
  const auto requests = rested_requests(table, seed);
  std::vector<recordings::Recording> recorded;
  for (std::size_t i = 0; i < requests.size(); ++i) {
    std::fprintf(stderr, "run %zu of %zu\n", i + 1, requests.size());
    recorded.push_back(
        through_usb(requests[i], store, folder.path / (std::to_string(i) + ".h5"), update_rate));
  }
  const auto usb = compare(recordings::published_table(table), recorded);
  // What the noise alone makes of it: the spread of several seeds without USB.
  constexpr int seeds = 4;
  std::vector<recordings::Comparison> direct;
  for (int s = 0; s < seeds; ++s)
    direct.push_back(server::run_table(table, rested_requests(table, seed + 100 + s), store, "",
                                       [](double) { return true; }));

  std::printf("%-40s %12s %12s %12s\n", "cell", "through USB", "without", "spread");
  int apart = 0;
  for (std::size_t i = 0; i < usb.cells.size(); ++i) {
    double mean = 0, least = INFINITY, most = -INFINITY;
    for (const auto& one : direct) {
      const double value = one.cells[i].measured.value_or(NAN);
      mean += value / seeds;
      least = std::min(least, value);
      most = std::max(most, value);
    }
    const double value = usb.cells[i].measured.value_or(NAN);
    // Three times the spread of four, and half a per mille for steps of the output and rounding.
    const bool good = std::abs(value - mean) <= 3 * (most - least) + 5e-4 * std::abs(mean);
    apart += good ? 0 : 1;
    std::string name = usb.cells[i].published.quantity;
    for (const auto& [key, k] : usb.cells[i].published.keys)
      name += " " + key + "=" + nlohmann::json(k).dump();
    std::printf("%-40s %12.5g %12.5g %12.2g%s\n", name.c_str(), value, mean, most - least,
                good ? "" : "  apart");
  }
  std::printf("%zu cells, %d apart\n", usb.cells.size(), apart);
  return apart == 0 ? EXIT_SUCCESS : EXIT_FAILURE;
}

}  // namespace
}  // namespace ferrobench::emulator

int main(int argc, char** argv) {
  std::string table;
  std::int64_t seed = 1;
  double update_rate = ferrobench::daq::usb::UsbConfig{}.update_rate;
  for (int i = 1; i < argc; ++i) {
    const std::string argument = argv[i];
    if (argument == "--seed" && i + 1 < argc)
      seed = std::atoll(argv[++i]);
    else if (argument == "--update-rate" && i + 1 < argc)
      update_rate = std::atof(argv[++i]);
    else
      table = argument;
  }
  if (table.empty() || table.starts_with("-")) {
    std::fputs("usage: ferrobench_usb_table_runs TABLE [--seed N] [--update-rate HZ]\n", stderr);
    return 2;
  }
  try {
    return ferrobench::emulator::run(table, seed, update_rate);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "ferrobench_usb_table_runs: %s\n", error.what());
    return 2;
  }
}

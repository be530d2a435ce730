// ferrobench_usb_fault_runs [--runs N] [--seed N]: runs with faults drawn from the seed, a table of what came
// of them, and exit code 1 if any promise was broken.
#include <cstdio>
#include <cstdlib>
#include <cstring>

#include "fault_bench.h"

namespace ferrobench::emulator {
namespace {

struct Tally {
  std::uint64_t runs = 0, noticed = 0, harmless = 0, at_zero = 0, rows = 0, broken = 0;
};

int run(std::uint64_t runs, std::uint64_t first_seed) {
  using daq::usb::StartMode;
  // One device for each kind of start, opened once: what a daemon has.
  FaultBench triggered(StartMode::trigger), clocked(StartMode::clock);
  std::array<Tally, fault_kinds> tallies;
  std::uint64_t broken = 0;
  for (std::uint64_t i = 0; i < runs; ++i) {
    const auto kind = static_cast<FaultKind>(i % fault_kinds);
    const std::uint64_t seed = first_seed + i / fault_kinds;
    FaultBench& bench = seed % 2 == 0 ? triggered : clocked;
    Tally& tally = tallies.at(static_cast<std::size_t>(kind));
    const auto faulty = bench.faulty(kind, seed);
    const auto sound = bench.sound(seed + 1);
    ++tally.runs;
    ++(faulty.whole ? tally.harmless : tally.noticed);
    tally.at_zero += faulty.at_zero ? 1 : 0;
    tally.rows += faulty.rows + sound.rows;
    for (const auto* result : {&faulty, &sound}) {
      if (result->crime.empty()) continue;
      ++tally.broken;
      ++broken;
      std::printf("%s, seed %llu%s: %s (%s)\n", std::string(fault_name(kind)).c_str(),
                  static_cast<unsigned long long>(seed), result == &sound ? ", the run after" : "",
                  result->crime.c_str(), result->said.c_str());
    }
    if (i % 100 == 99)
      std::fprintf(stderr, "%llu of %llu runs\r", static_cast<unsigned long long>(i + 1),
                   static_cast<unsigned long long>(runs));
  }
  std::printf("%-15s %6s %8s %9s %8s %8s %12s %7s\n", "fault", "runs", "noticed", "harmless", "at zero",
              "said not", "rows checked", "broken");
  for (int k = 0; k < fault_kinds; ++k) {
    const Tally& t = tallies.at(static_cast<std::size_t>(k));
    const auto number = [](std::uint64_t n) { return static_cast<unsigned long long>(n); };
    std::printf("%-15s %6llu %8llu %9llu %8llu %8llu %12llu %7llu\n",
                std::string(fault_name(static_cast<FaultKind>(k))).c_str(), number(t.runs), number(t.noticed),
                number(t.harmless), number(t.at_zero), number(t.runs - t.at_zero), number(t.rows),
                number(t.broken));
  }
  return broken == 0 ? EXIT_SUCCESS : EXIT_FAILURE;
}

}  // namespace
}  // namespace ferrobench::emulator

int main(int argc, char** argv) {
  std::uint64_t runs = 1000, seed = 1;
  for (int i = 1; i + 1 < argc; i += 2) {
    const auto value = std::strtoull(argv[i + 1], nullptr, 10);
    if (std::strcmp(argv[i], "--runs") == 0)
      runs = value;
    else if (std::strcmp(argv[i], "--seed") == 0)
      seed = value;
    else
      argc = 0;
  }
  if (argc % 2 == 0) {
    std::fputs("usage: ferrobench_usb_fault_runs [--runs N] [--seed N]\n", stderr);
    return 2;
  }
  return ferrobench::emulator::run(runs, seed);
}

// ferrobench_usb_alignment [--samples N]: input and output stay aligned to one tick, over N samples (10^7) in
// the unit's own time. Every sample is compared with its place in a pattern, every field with the level asked
// for; the level moves by more between two ticks than the converters round.
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>

#include "rig.h"
#include "tests/daq/programs.h"

namespace ferrobench::emulator {
namespace {

constexpr double rate = 100e3;  // rows/s of 4 columns and the marker: 500 kS/s

int run(std::uint64_t samples) {
  ProofBoard board;
  Rig rig(proof_config(), board);
  auto& device = rig.device();
  const double duration = static_cast<double>(samples) / 5 / rate;
  // Triangles of 20 ms: 1,500 V/m from tick to tick.
  std::vector<protocols::Piece> pieces;
  for (double time = 0; time < duration; time += 0.02) {
    pieces.push_back(daq::line(0, 1.5e6, 0.01));
    pieces.push_back(daq::line(1.5e6, 0, 0.01));
  }
  daq::Limits limits;
  limits.slew = 1e9;
  daq::Guard guard(device, limits);
  guard.start(daq::program(std::move(pieces), device.scan_rate(rate)));
  const auto columns = device.columns();
  std::uint64_t rows = 0, wrong = 0;
  double furthest = 0;
  for (daq::SampleBlock block; guard.read(block);) {
    for (std::size_t r = 0; r < block.rows; ++r, ++rows) {
      const auto value = [&](std::size_t c) {
        return columns[c].offset + columns[c].gain * block.counts[r * columns.size() + c];
      };
      if (block.first_sample + r != rows) ++wrong;
      constexpr std::array sensitivity{1e5, 2e5, 0.02};
      for (unsigned c = 1; c <= 3; ++c)
        if (!(std::abs(value(c) * sensitivity.at(c - 1) - ProofBoard::pattern(rows, c)) < 0.25e-3)) ++wrong;
      furthest = std::max(furthest, std::abs(value(0) - block.command[r]));
    }
  }
  const bool good = guard.outcome().end == daq::End::complete && wrong == 0 && furthest < 0.1 * 1500;
  std::printf(
      "%llu rows, %llu samples, %llu wrong; field at most %.0f V/m from the one asked for, a tick is 1500 "
      "V/m; %s\n",
      static_cast<unsigned long long>(rows), static_cast<unsigned long long>(5 * rows),
      static_cast<unsigned long long>(wrong), furthest,
      guard.outcome().reason.empty() ? "complete" : guard.outcome().reason.c_str());
  return good ? EXIT_SUCCESS : EXIT_FAILURE;
}

}  // namespace
}  // namespace ferrobench::emulator

int main(int argc, char** argv) {
  const bool given = argc == 3 && std::strcmp(argv[1], "--samples") == 0;
  return ferrobench::emulator::run(given ? std::strtoull(argv[2], nullptr, 10) : 10'000'000);
}

#include "unit/faults.h"

#include <array>
#include <random>

#include "unit/requests.h"

namespace ferrobench::emulator {

std::string_view fault_name(FaultKind kind) {
  static constexpr std::array<std::string_view, fault_kinds> names{
      "overrun",    "underrun",    "unplug",       "bus_loss",     "hang",
      "input_halt", "output_halt", "short_packet", "lost_sample",  "doubled_sample",
      "stall",      "cut_answer",  "rotated",      "fpga_refuses", "rate_error"};
  return names.at(static_cast<std::size_t>(kind));
}

Faults draw_fault(FaultKind kind, std::uint64_t seed, std::uint64_t scans) {
  // The engine's sequence is fixed by the standard, unlike the distributions.
  std::mt19937_64 random(seed * fault_kinds + static_cast<std::uint64_t>(kind));
  const auto below = [&](std::uint64_t n) { return n == 0 ? 0 : random() % n; };
  Faults faults;
  const std::uint64_t moment = below(scans);
  switch (kind) {
    case FaultKind::overrun:
      faults.overrun = moment;
      break;
    case FaultKind::underrun:
      faults.underrun = moment;
      break;
    case FaultKind::unplug:
      faults.unplug = moment;
      break;
    case FaultKind::bus_loss:
      faults.bus_loss = moment;
      break;
    case FaultKind::hang:
      faults.hang = moment;
      break;
    case FaultKind::input_halt:
      faults.input_halt = moment;
      break;
    case FaultKind::output_halt:
      faults.output_halt = moment;
      break;
    case FaultKind::short_packet:
      faults.short_packet = moment;
      break;
    case FaultKind::lost_sample:
      faults.lost_sample = moment;
      break;
    case FaultKind::doubled_sample:
      faults.doubled_sample = moment;
      break;
    case FaultKind::stall: {
      static constexpr std::array used{request::tristate,     request::latch,        request::input_start,
                                       request::input_stop,   request::queue,        request::input_clear,
                                       request::output_value, request::output_start, request::output_stop,
                                       request::output_clear, request::memory,       request::memory_address,
                                       request::status,       request::trigger};
      const std::uint8_t stalled = used[below(used.size())];
      faults.stall = StalledRequest{stalled, static_cast<unsigned>(1 + below(3))};
      break;
    }
    case FaultKind::cut_answer: {
      static constexpr std::array read{request::status, request::memory, request::fpga_version};
      const std::uint8_t cut = read[below(read.size())];
      faults.cut_answer = CutAnswer{cut, static_cast<unsigned>(1 + below(3)), below(2)};
      break;
    }
    case FaultKind::rotated:
      faults.rotated = true;
      break;
    case FaultKind::fpga_refuses:
      faults.fpga_refuses = true;
      break;
    case FaultKind::rate_error:
      faults.rate_error = (below(2) == 0 ? 1 : -1) * (1e-3 + 1e-5 * static_cast<double>(below(9900)));
      faults.input_rate_only = below(2) == 0;
      break;
  }
  return faults;
}

}  // namespace ferrobench::emulator

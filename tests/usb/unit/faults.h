// What goes wrong with a unit, and when. Moments are scans since START, so that they mean the same at any
// rate; each fault happens once, then the unit is sound again (an unplugged one after plug()).
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string_view>

namespace ferrobench::emulator {

struct StalledRequest {
  std::uint8_t request = 0;
  unsigned nth = 1;  // 1: the next one
};

struct CutAnswer {
  std::uint8_t request = 0;
  unsigned nth = 1;
  std::size_t length = 0;  // bytes that come instead of the true number
};

struct Faults {
  std::optional<std::uint64_t> overrun{}, underrun{};  // the flag comes up and the scan ends
  std::optional<std::uint64_t> unplug{};               // power and bus are gone
  std::optional<std::uint64_t> bus_loss{};  // the bus is gone, the unit keeps its power and plays on
  std::optional<std::uint64_t> hang{};      // the unit takes and gives no more data; STOP mends it
  std::optional<std::uint64_t> input_halt{}, output_halt{};  // the endpoint stalls until CLEAR_HALT
  std::optional<std::uint64_t> short_packet{};               // a packet is cut, the rest follows in the next
  std::optional<std::uint64_t> lost_sample{};                // one sample is missing from the stream
  std::optional<std::uint64_t> doubled_sample{};             // one sample comes twice
  std::optional<StalledRequest> stall{};
  std::optional<CutAnswer> cut_answer{};
  bool rotated = false;          // the next continuous scan begins one channel late
  bool fpga_refuses = false;     // the next bitstream does not configure
  double rate_error = 0;         // pacers run faster by this share; stays until changed
  bool input_rate_only = false;  // rate_error is the input pacer's alone
};

enum class FaultKind {
  overrun,
  underrun,
  unplug,
  bus_loss,
  hang,
  input_halt,
  output_halt,
  short_packet,
  lost_sample,
  doubled_sample,
  stall,
  cut_answer,
  rotated,
  fpga_refuses,
  rate_error
};
inline constexpr int fault_kinds = 15;
std::string_view fault_name(FaultKind kind);

// A fault of this kind at a moment drawn from the seed, within the first `scans` of a scan.
Faults draw_fault(FaultKind kind, std::uint64_t seed, std::uint64_t scans);

}  // namespace ferrobench::emulator

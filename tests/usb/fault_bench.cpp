#include "fault_bench.h"

#include <array>
#include <cmath>

#include "tests/daq/programs.h"

namespace ferrobench::emulator {

using daq::line;
using daq::usb::PaceWatch;

namespace {

constexpr double top = 1.5e6;  // V/m
// Row rates: packets of a few ticks, oversampled and not, and full ones.
constexpr std::array<double, 3> rates{1000, 5000, 25000};  // Hz

std::vector<protocols::Piece> up_and_down() {
  return {line(0, top, 0.4), line(top, top, 0.2), line(top, 0, 0.6)};
}
constexpr double duration = 1.2, steepest = top / 0.4;  // s, V/m/s

// Half a code of the output and half a code of the input. A tick earlier or later is further away.
constexpr double rounding = 80;               // V/m
constexpr double pattern_rounding = 0.25e-3;  // V
// Two pacers that drift apart: as far as the monitor's check lets them.
constexpr double drifting = 2e4 + 2 * steepest * 0.0025;

double rate_of(std::uint64_t seed) {
  return rates.at(seed % rates.size());
}

}  // namespace

bool must_be_noticed(FaultKind kind) {
  switch (kind) {
    case FaultKind::short_packet:
    case FaultKind::stall:
    case FaultKind::cut_answer:
    case FaultKind::rate_error:
      return false;
    default:
      return true;
  }
}

FaultBench::FaultBench(daq::usb::StartMode start) : rig_(proof_config(start), board_) {
  board_.keep_times = true;
}

void FaultBench::check_rows(const daq::SampleBlock& block, std::uint64_t oversampling, double field_tolerance,
                            Result& result) const {
  constexpr std::array sensitivity{1e5, 2e5, 0.02};  // of charge, displacement, force
  const auto columns = const_cast<Rig<ProofBoard>&>(rig_).device().columns();
  for (std::size_t r = 0; r < block.rows && result.crime.empty(); ++r) {
    const std::uint64_t row = block.first_sample + r;
    const auto value = [&](std::size_t c) {
      return columns[c].offset + columns[c].gain * block.counts[r * columns.size() + c];
    };
    for (unsigned c = 1; c <= 3; ++c) {
      const double expected = ProofBoard::pattern(row * oversampling, c);
      if (!(std::abs(value(c) * sensitivity.at(c - 1) - expected) <= pattern_rounding))
        result.crime = "row " + std::to_string(row) + " has a wrong sample of input " + std::to_string(c);
    }
    if (!(std::abs(value(0) - block.command[r]) <= field_tolerance))
      result.crime = "row " + std::to_string(row) + " has the field " + std::to_string(value(0)) +
                     " instead of " + std::to_string(block.command[r]);
  }
  if (block.first_sample != result.rows && block.rows > 0) result.crime = "rows are missing in between";
  result.rows = block.rows > 0 ? block.first_sample + block.rows : result.rows;
}

// The rows handed on were taken when they say.
std::string FaultBench::check_times(std::uint64_t ticks, double tick_rate, double allowed) const {
  const auto& times = board_.times();
  for (std::uint64_t k = 0; k < ticks; ++k) {
    const double taken = static_cast<double>(times[k] - times[0]) / static_cast<double>(ticks_per_second);
    if (std::abs(taken - static_cast<double>(k) / tick_rate) > allowed + PaceWatch::share * taken)
      return "tick " + std::to_string(k) + " was taken at " + std::to_string(taken) + " s";
  }
  return {};
}

FaultBench::Result FaultBench::play(std::uint64_t seed, double field_tolerance) {
  Result result;
  auto& device = rig_.device();
  daq::Guard guard(device, daq::Limits{});
  std::uint64_t rows = 0;
  try {
    auto waveform = daq::program(up_and_down(), device.scan_rate(rate_of(seed)));
    rows = waveform.size();
    guard.go_to(0, 1e6);
    board_.restart();  // a unit that had lost its bus went on converting until now
    guard.start(std::move(waveform));
    const std::uint64_t oversampling = device.info().at("oversampling");
    for (daq::SampleBlock block; guard.read(block);) check_rows(block, oversampling, field_tolerance, result);
  } catch (const Error& error) {
    result.said = error.what();
  }
  const auto outcome = guard.outcome();
  if (outcome.end == daq::End::complete && result.said.empty()) {
    result.whole = result.rows == rows;
    if (!result.whole) result.crime = "a complete run has " + std::to_string(result.rows) + " rows";
  } else if (result.said.empty()) {
    result.said = outcome.reason;
    if (result.said.empty()) result.crime = "nothing was said";
  }
  // Refused before the guard had anything to end: the device itself knows where its output is.
  result.at_zero = outcome.end == daq::End::none ? device.output() == 0 : outcome.output_at_zero;
  if (result.at_zero && !(std::abs(rig_.output_volts()) < 0.5e-3))
    result.crime =
        "the output is at " + std::to_string(rig_.unit.output_voltage(0)) + " V and said to be at 0";
  if (!result.at_zero && rig_.unit.on_bus())
    result.crime = "a unit that is there was not brought to zero: " + result.said;
  return result;
}

FaultBench::Result FaultBench::faulty(FaultKind kind, std::uint64_t seed) {
  auto& device = rig_.device();
  const auto rate = device.scan_rate(rate_of(seed));
  const double tick_rate = rate * std::max(1.0, std::ceil(2000 / rate));
  const auto faults = draw_fault(kind, seed, static_cast<std::uint64_t>(duration * tick_rate));
  if (kind == FaultKind::fpga_refuses) {  // one that has just got its power
    rig_.unit.unplug();
    rig_.unit.plug();
  }
  rig_.unit.arm(faults);
  auto result = play(seed, faults.rate_error != 0 ? drifting : rounding);
  rig_.unit.arm({});
  if (result.crime.empty() && result.whole && must_be_noticed(kind)) result.crime = "it was not noticed";
  if (result.crime.empty() && result.rows > 0) {
    const double oversampling = device.info().at("oversampling");
    const auto ticks = static_cast<std::uint64_t>(static_cast<double>(result.rows - 1) * oversampling) + 1;
    const double late = PaceWatch::late + std::abs(faults.rate_error) * 2 * PaceWatch::window;
    result.crime = check_times(ticks, device.info().at("tick_rate"), late);
  }
  return result;
}

FaultBench::Result FaultBench::sound(std::uint64_t seed) {
  if (!rig_.unit.on_bus()) rig_.unit.plug();
  auto result = play(seed, rounding);
  if (result.crime.empty() && !result.whole) result.crime = "a sound unit was refused: " + result.said;
  if (result.crime.empty() && !result.at_zero) result.crime = "the output is not at zero";
  return result;
}

}  // namespace ferrobench::emulator

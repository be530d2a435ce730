// A configured unit with its board, for the programs that offer it to others; and the clock that drives it.
#pragma once

#include <chrono>
#include <memory>
#include <optional>
#include <string>

#include "boards/virtual_bench.h"
#include "host/port.h"

namespace ferrobench::emulator {

enum class BoardKind { loopback, pattern, proof, bench };
std::span<const std::pair<BoardKind, std::string_view>> enum_names(BoardKind);
std::span<const std::pair<Speed, std::string_view>> enum_names(Speed);
std::span<const std::pair<TriggerSource, std::string_view>> enum_names(TriggerSource);
std::span<const std::pair<ClockSource, std::string_view>> enum_names(ClockSource);
std::span<const std::pair<FaultKind, std::string_view>> enum_names(FaultKind);

// One JSON file for the programs. The default: outputs looped back to the even and odd inputs, DIO0 jumpered
// to TRIG, FPGA empty.
struct EmulatorConfig {
  BoardKind board = BoardKind::loopback;
  BenchConfig bench;
  std::int64_t product = 0x0136;
  std::string serial = "01A2B3C4";
  bool fpga_loaded = false;
  Speed speed = Speed::high;
  bool perfect = false;  // converters without errors
  TriggerSource trigger = TriggerSource::dio0;
  ClockSource input_clock = ClockSource::output_clock_out, output_clock = ClockSource::none;
  std::optional<FaultKind> fault;
  std::int64_t fault_seed = 1, fault_scans = 10'000;
  double patience = 0.5;  // s
  std::string output_log{};
};

template <class Visitor>
void describe(Visitor& visit, EmulatorConfig& c) {
  visit("board", c.board,
        {.doc = "loopback: outputs to inputs; pattern: a known pattern; proof: a pattern by input "
                "beside a loop-back and a marker; bench: a virtual bench"});
  visit("bench", c.bench, {.doc = "the virtual bench"});
  visit("product", c.product, {.min = 0x0110, .max = 0x0136, .doc = "USB product id"});
  visit("serial", c.serial, {.doc = "8 characters"});
  visit("fpga_loaded", c.fpga_loaded, {.doc = "as if a host had been here since power-up"});
  visit("speed", c.speed, {.doc = "of the port that it is plugged into: packets of 512 bytes or of 64"});
  visit("perfect", c.perfect, {.doc = "converters without errors of gain and offset"});
  visit("trigger", c.trigger, {.doc = "what the TRIG terminal is jumpered to"});
  visit("input_clock", c.input_clock, {.doc = "what the AI clock input is jumpered to"});
  visit("output_clock", c.output_clock, {.doc = "what the AO clock input is jumpered to"});
  visit("fault", c.fault, {.doc = "a fault that the unit has once"});
  visit("fault_seed", c.fault_seed, {.min = 0, .doc = "of the moment of the fault"});
  visit("fault_scans", c.fault_scans, {.min = 1, .doc = "the moment is within so many scans"});
  visit(
      "patience", c.patience,
      {.unit = "s",
       .min = 0,
       .max = 10,
       .doc =
           "how long the unit's time may stand still where a FIFO is about to fail for want of a transfer: a "
           "loaded machine is not a broken driver"});
  visit(
      "output_log", c.output_log,
      {.doc = "file for the voltage of output 0: a line at each change with the unit's time, the time of day "
              "(both s) and the voltage"});
}

// Throws Error(invalid_params).
EmulatorConfig emulator_config_from_json(const nlohmann::json& json);

class Emulator {
 public:
  // Throws Error(invalid_params | not_found | bad_model).
  explicit Emulator(const EmulatorConfig& config);

  Port& port() { return port_; }
  Unit& unit() { return unit_; }
  // The unit's time catches up with the clock.
  void keep_up();

 private:
  using Clock = std::chrono::steady_clock;
  static constexpr Ticks step = ticks_per_second / 1000;
  // The scan is about to fail because the host has no transfer ready.
  bool starved() const;

  EmulatorConfig config_;
  std::unique_ptr<Board> board_;
  Unit unit_;
  Port port_{unit_};
  Clock::time_point reached_ = Clock::now();          // by the unit's time
  std::optional<Clock::time_point> starved_since_{};  // it waits for the host
};

}  // namespace ferrobench::emulator

#include "host/emulator.h"

#include <algorithm>

#include "boards/logged.h"
#include "boards/loopback.h"
#include "boards/proof.h"

namespace ferrobench::emulator {

std::span<const std::pair<BoardKind, std::string_view>> enum_names(BoardKind) {
  static constexpr std::array<std::pair<BoardKind, std::string_view>, 4> names{
      {{BoardKind::loopback, "loopback"},
       {BoardKind::pattern, "pattern"},
       {BoardKind::proof, "proof"},
       {BoardKind::bench, "bench"}}};
  return names;
}

std::span<const std::pair<Speed, std::string_view>> enum_names(Speed) {
  static constexpr std::array<std::pair<Speed, std::string_view>, 2> names{
      {{Speed::high, "high"}, {Speed::full, "full"}}};
  return names;
}

std::span<const std::pair<TriggerSource, std::string_view>> enum_names(TriggerSource) {
  static constexpr std::array<std::pair<TriggerSource, std::string_view>, 3> names{
      {{TriggerSource::pin, "pin"}, {TriggerSource::dio0, "dio0"}, {TriggerSource::timer, "timer"}}};
  return names;
}

std::span<const std::pair<ClockSource, std::string_view>> enum_names(ClockSource) {
  static constexpr std::array<std::pair<ClockSource, std::string_view>, 4> names{
      {{ClockSource::none, "none"},
       {ClockSource::input_clock_out, "input_clock_out"},
       {ClockSource::output_clock_out, "output_clock_out"},
       {ClockSource::timer, "timer"}}};
  return names;
}

std::span<const std::pair<FaultKind, std::string_view>> enum_names(FaultKind) {
  static const auto names = [] {
    std::array<std::pair<FaultKind, std::string_view>, fault_kinds> out;
    for (std::size_t i = 0; i < out.size(); ++i)
      out.at(i) = {static_cast<FaultKind>(i), fault_name(static_cast<FaultKind>(i))};
    return out;
  }();
  return names;
}

EmulatorConfig emulator_config_from_json(const nlohmann::json& json) {
  auto config = parse<EmulatorConfig>(json.is_null() ? nlohmann::json::object() : json,
                                      ErrorCode::invalid_params, "the emulator's configuration");
  if (config.serial.size() != 8)
    throw Error(ErrorCode::invalid_params, "the emulator's configuration",
                Problem{.path = "/serial",
                        .message = "has not 8 characters",
                        .given = config.serial,
                        .allowed = "8 characters",
                        .hint = "for example 01A2B3C4"});
  return config;
}

namespace {

std::unique_ptr<Board> board_of(const EmulatorConfig& config) {
  switch (config.board) {
    case BoardKind::pattern:
      return std::make_unique<PatternBoard>();
    case BoardKind::proof:
      return std::make_unique<ProofBoard>();
    case BoardKind::bench:
      return std::make_unique<VirtualBench>(config.bench);
    default:
      break;
  }
  auto board = std::make_unique<LoopbackBoard>();
  for (unsigned i = 0; i < board->jumpers.size(); ++i) board->jumpers.at(i).output = i % 2;
  return board;
}

std::unique_ptr<Board> logged(std::unique_ptr<Board> board, const std::string& log) {
  if (log.empty()) return board;
  return std::make_unique<LoggedBoard>(std::move(board), log);
}

UnitSetup setup_of(const EmulatorConfig& config) {
  UnitSetup setup;
  setup.product = static_cast<std::uint16_t>(config.product);
  setup.serial = config.serial;
  setup.fpga_loaded = config.fpga_loaded;
  setup.speed = config.speed;
  if (config.perfect) {
    setup.calibration.input.fill({});
    setup.calibration.output.fill({});
  }
  setup.wiring.trigger = config.trigger;
  setup.wiring.input_clock = config.input_clock;
  setup.wiring.output_clock = config.output_clock;
  return setup;
}

}  // namespace

Emulator::Emulator(const EmulatorConfig& config)
    : config_(config), board_(logged(board_of(config), config.output_log)), unit_(setup_of(config), *board_) {
  if (config.fault)
    unit_.arm(draw_fault(*config.fault, static_cast<std::uint64_t>(config.fault_seed),
                         static_cast<std::uint64_t>(config.fault_scans)));
}

bool Emulator::starved() const {
  return (port_.in_under_way() == 0 && unit_.input_overruns_within(step)) ||
         (port_.out_under_way() == 0 && unit_.output_runs_dry_within(step));
}

void Emulator::keep_up() {
  const auto now = Clock::now();
  // Step by step: a transfer that ends in between may leave the host without any.
  constexpr std::chrono::nanoseconds longest{step * 125 / 8};
  while (reached_ < now) {
    if (!starved())
      starved_since_.reset();
    else if (!starved_since_)
      starved_since_ = now;
    if (starved_since_ && std::chrono::duration<double>(now - *starved_since_).count() < config_.patience)
      return;
    const auto passed = std::min<std::chrono::nanoseconds>(now - reached_, longest);
    port_.advance(port_.now() + static_cast<Ticks>(passed.count()) * 8 / 125);
    reached_ += passed;
  }
}

}  // namespace ferrobench::emulator

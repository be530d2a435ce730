// The driver on the emulated unit: two readings of one protocol note.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>

#include "fault_bench.h"
#include "tests/daq/programs.h"
#include "unit/requests.h"

namespace ferrobench::emulator {
namespace {

using daq::usb::StartMode;
using testing::HasSubstr;
using testing::Not;

constexpr double half_code = 10.0 / 65536;  // V

TEST(Driver, LoadsTheFpgaOfAUnitThatHasJustGotItsPower) {
  ProofBoard board;
  Rig rig(proof_config(), board);
  EXPECT_TRUE(rig.device().info().at("fpga_loaded"));
  rig.close();
  EXPECT_FALSE(rig.device().info().at("fpga_loaded")) << "it keeps its configuration";
  EXPECT_EQ(rig.device().info().at("serial_number"), "01A2B3C4");
}

TEST(Driver, ReadsTheCalibrationAndAppliesIt) {
  ProofBoard board;
  Rig rig(proof_config(), board);
  const auto calibration = rig.device().info().at("calibration");
  const auto& line = rig.unit.setup().calibration;
  EXPECT_FLOAT_EQ(calibration.at("output").at(0).at("slope").get<float>(), line.output[0].slope);
  EXPECT_FLOAT_EQ(calibration.at("input").at(0).at("offset").get<float>(), line.input[0].offset);
  for (const double volts : {0.0, 7.5, -8.25, 1e-3, 0.0}) {
    rig.device().go_to(volts * field_of_volt, 1e7);
    EXPECT_NEAR(rig.output_volts(), volts, half_code * 1.01);
    EXPECT_EQ(rig.device().output(), volts * field_of_volt);
  }
}

TEST(Driver, GoesToALevelAtTheSlewAskedFor) {
  ProofBoard board;
  Rig rig(proof_config(), board);
  rig.device();
  const auto before = rig.clock.now();
  rig.device().go_to(1e6, 2e6);
  EXPECT_NEAR(std::chrono::duration<double>(rig.clock.now() - before).count(), 0.5, 0.01);
}

TEST(Driver, LeavesTheOutputAtZero) {
  ProofBoard board;
  Rig rig(proof_config(), board);
  rig.device().go_to(1e6, 1e7);
  rig.close();
  EXPECT_NEAR(rig.output_volts(), 0, half_code * 1.01);
}

TEST(Driver, BringsDownAVoltageThatItFinds) {
  ProofBoard board;
  Rig rig(proof_config(), board);
  rig.device();
  rig.close();
  std::vector<std::byte> answer;
  rig.port.control(
      {.type = vendor_out, .number = request::output_value, .value = 0xF000, .index = 0, .length = 0}, {},
      answer);
  ASSERT_GT(rig.output_volts(), 8);
  rig.device();
  EXPECT_NEAR(rig.output_volts(), 0, half_code * 1.01);
}

class DriverRun : public testing::TestWithParam<StartMode> {};

// Every sample against its place in the pattern and the field at its tick, at three rates.
TEST_P(DriverRun, BringsEveryRowAtItsPlace) {
  FaultBench bench(GetParam());
  for (std::uint64_t seed = 0; seed < 3; ++seed) {
    const auto result = bench.sound(seed);
    EXPECT_EQ(result.crime, "");
    EXPECT_TRUE(result.whole) << result.said;
    EXPECT_GT(result.rows, 1000U);
  }
}
INSTANTIATE_TEST_SUITE_P(Starts, DriverRun, testing::Values(StartMode::trigger, StartMode::clock),
                         [](const auto& p) { return p.param == StartMode::trigger ? "trigger" : "clock"; });

// What the device says of the end of a run at this rate.
daq::SampleBlock last_block(daq::Device& device, double rate, daq::LevelSource& source) {
  device.start(device.scan_rate(rate), source);
  daq::SampleBlock last, block;
  while (device.read(block))
    if (block.status != daq::BlockStatus::ok) last = block;
  return last;
}

// Zero for ever; at a row it can keep the computer from everything else for a while.
struct Endless final : daq::LevelSource {
  daq::LinearPiece next(std::uint64_t most) override {
    given += most;
    if (port != nullptr && given > doze_at)
      std::exchange(port, nullptr)->advance(unit->now() + ticks_per_second * 3 / 5);
    return {.samples = most};
  }
  std::uint64_t given = 0, doze_at = 0;
  Port* port = nullptr;
  Unit* unit = nullptr;
};

// The unit's FIFO overruns, as nobody takes what is in it. But the computer waits for it.
TEST(Driver, AnEndpointThatHangsIsNotTheComputersFault) {
  for (const double update_rate : {0.0, 4e3, 40e3})
    for (const double rate : {200.0, 1000.0, 25000.0}) {
      ProofBoard board;
      auto config = proof_config();
      config["update_rate"] = update_rate;
      Rig rig(config, board);
      auto& device = rig.device();
      const auto tick_rate = std::max(rate, update_rate);
      rig.unit.arm({.hang = static_cast<std::uint64_t>(0.4 * tick_rate)});
      Endless source;
      const auto last = last_block(device, rate, source);
      EXPECT_EQ(last.status, daq::BlockStatus::timeout)
          << rate << ", " << update_rate << ": " << last.message;
      EXPECT_THAT(last.message, HasSubstr("no sample came for "));
      EXPECT_THAT(last.message, HasSubstr("though"));
      EXPECT_THAT(last.message, HasSubstr("cable"));
      EXPECT_THAT(last.message, Not(HasSubstr("free the computer")));
      device.go_to(0, 1e6);
      EXPECT_EQ(device.output(), 0);
    }
}

TEST(Driver, AnOverrunIsTheComputersFaultIfItWasAway) {
  ProofBoard board;
  Rig rig(proof_config(), board);
  auto& device = rig.device();
  Endless source;
  source.doze_at = 1000;
  source.port = &rig.port;
  source.unit = &rig.unit;
  const auto last = last_block(device, 1000, source);
  EXPECT_EQ(last.status, daq::BlockStatus::overrun) << last.message;
  EXPECT_THAT(last.message, HasSubstr("free the computer"));
  EXPECT_THAT(last.message, Not(HasSubstr("cable")));
}

TEST(Driver, SaysWhichWireIsMissing) {
  for (const auto mode : {StartMode::trigger, StartMode::clock}) {
    ProofBoard board;
    Rig rig(proof_config(mode), board, UnitSetup{});
    daq::Guard guard(rig.device(), daq::Limits{});
    guard.start(daq::program({daq::line(0, 1e5, 0.5), daq::line(1e5, 0, 0.5)}, rig.device().scan_rate(1000)));
    daq::SampleBlock block;
    while (guard.read(block)) EXPECT_EQ(block.rows, 0U);
    EXPECT_EQ(guard.outcome().end, daq::End::fault);
    EXPECT_THAT(guard.outcome().reason,
                HasSubstr(mode == StartMode::trigger ? "DIO0 to TRIG" : "clock pin to the input's"));
    EXPECT_TRUE(guard.outcome().output_at_zero);
  }
}

TEST(Driver, RefusesUnitsWithoutOutputs) {
  ProofBoard board;
  auto setup = jumpered();
  setup.product = 0x0135;
  Rig rig(proof_config(), board, setup);
  try {
    rig.device();
    FAIL();
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("no analog output"));
  }
}

TEST(Driver, DrivesBothRevisions) {
  for (const std::uint16_t product : {0x0112, 0x0136}) {
    ProofBoard board;
    auto setup = jumpered();
    setup.product = product;
    Rig rig(proof_config(), board, setup);
    EXPECT_EQ(rig.device().info().at("product"), "USB-1608GX-2AO");
  }
}

}  // namespace
}  // namespace ferrobench::emulator

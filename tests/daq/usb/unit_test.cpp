#include "daq/usb/unit.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "daq/usb/calibration.h"
#include "daq/usb/fpga.h"
#include "tests/daq/usb/fake_unit.h"

namespace ferrobench::daq::usb {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

struct UnitTest : testing::Test {
  UnitTest() { calibrate(state); }
  FakeState state;
  Unit unit{std::make_unique<FakeUnit>(state)};
};

TEST_F(UnitTest, SaysEveryRequestByteByByte) {
  unit.stop_input();
  unit.clear_input();
  unit.stop_output();
  unit.clear_output();
  unit.trigger_on_rising_edge();
  unit.set_inputs(0xFE);
  unit.set_latch(0x81);
  unit.write_output(1, 0x1234);
  const std::vector<QueueElement> queue{
      {.channel = 3, .range = InputRange::v2},
      {.channel = 5, .range = InputRange::v10, .mode = InputMode::single_ended},
      {.channel = 13, .range = InputRange::v1, .mode = InputMode::single_ended}};
  unit.load_queue(queue);
  unit.start_input({.period = 512, .packet_samples = 256, .triggered = true});
  unit.start_input({.period = 0, .packet_samples = 40});
  unit.start_output({.period = 64000, .channel = 1, .triggered = true});
  EXPECT_THAT(state.requests,
              ElementsAre("4013 00000000 ", "4015 00000000 ", "401b 00000000 ", "401c 00000000 ",
                          "4043 00000000 03", "4000 fe000000 ", "4002 81000000 ", "4018 34120100 ",
                          "4014 00000000 1325dd00000000000000000000000000",
                          "4012 00000000 0000000000000000ff010000ff0900",
                          "4012 00000000 000000000000000000000000270100",
                          "401a 00000000 0000000000000000fff9000012"));
}

TEST_F(UnitTest, TriesAHarmlessRequestOnceMoreAndAStartNever) {
  int failures = 1;
  state.refuse = [&](const std::string&) { return failures-- > 0 ? LinkStatus::timeout : LinkStatus::ok; };
  unit.stop_output();
  EXPECT_EQ(state.requests.size(), 2U);
  failures = 1;
  EXPECT_EQ(unit.status().word, 0x0100);
  state.requests.clear();
  failures = 1;
  EXPECT_THROW(unit.start_output({.period = 64}), LinkFailure);
  EXPECT_EQ(state.requests.size(), 1U);
  failures = 2;
  try {
    unit.stop_input();
    FAIL();
  } catch (const LinkFailure& failure) {
    EXPECT_EQ(failure.status(), LinkStatus::timeout);
    EXPECT_EQ(failure.code(), ErrorCode::device_lost);
    EXPECT_THAT(failure.what(), HasSubstr("stop of the input scan (0x13)"));
  }
}

TEST_F(UnitTest, DemandsTheExactLengthOfAnAnswer) {
  struct Short final : Link {
    std::size_t packet_bytes(std::uint8_t) const override { return 512; }
    DeviceId id() const override { return {vendor_id, 0x0112, 0, "1", ""}; }
    LinkStatus control_out(const ControlRequest&, std::span<const std::byte>,
                           std::chrono::milliseconds) override {
      return LinkStatus::ok;
    }
    LinkStatus control_in(const ControlRequest&, std::span<std::byte>, std::size_t& actual,
                          std::chrono::milliseconds) override {
      actual = 1;
      return LinkStatus::ok;
    }
    LinkStatus clear_halt(std::uint8_t) override { return LinkStatus::ok; }
    LinkStatus submit_in(std::uint8_t, std::span<std::byte>, std::uint64_t) override {
      return LinkStatus::ok;
    }
    LinkStatus submit_out(std::uint8_t, std::span<const std::byte>, std::uint64_t) override {
      return LinkStatus::ok;
    }
    void cancel_all() override {}
    void wait(std::chrono::milliseconds, std::vector<Completion>&) override {}
  };
  Unit answers_short(std::make_unique<Short>());
  EXPECT_THROW(answers_short.status(), LinkFailure);
  std::vector<std::byte> memory(8);
  EXPECT_THROW(answers_short.read_memory(0x7000, memory), LinkFailure);
  EXPECT_FALSE(answers_short.read_output(0));
}

TEST_F(UnitTest, ReadsMemoryInPiecesEachAtItsAddress) {
  for (std::uint16_t i = 0; i < 150; ++i) state.eeprom[static_cast<std::uint16_t>(0x7410 + i)] = std::byte(i);
  std::vector<std::byte> memory(150);
  int call = 0;
  state.refuse = [&](const std::string&) { return ++call == 4 ? LinkStatus::stall : LinkStatus::ok; };
  unit.read_memory(0x7410, memory);
  for (std::size_t i = 0; i < memory.size(); ++i) ASSERT_EQ(memory[i], std::byte(i));
  EXPECT_THAT(state.requests,
              ElementsAre("4031 00000000 1074", "c030 00000000 ", "4031 00000000 5074", "c030 00000000 ",
                          "4031 00000000 5074", "c030 00000000 ", "4031 00000000 9074", "c030 00000000 "));
}

TEST_F(UnitTest, RefusesWhatItDoesNotSpeakTo) {
  for (const std::uint16_t product : {0x013E, 0x0001}) {
    FakeState other;
    other.product = product;
    try {
      Unit refused(std::make_unique<FakeUnit>(other));
      FAIL();
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::device_unavailable);
      EXPECT_THAT(error.what(), HasSubstr("USB-1608GX-2AO"));
    }
  }
}

TEST_F(UnitTest, CalibrationGoesBothWays) {
  calibrate(state, 1.01F, -30);
  const auto c = read_calibration(unit);
  EXPECT_NEAR(c.volts(InputRange::v5, 40000), (1.01 * 40000 - 30 - 32768) * 5 / 32768, 1e-5);
  for (const double volts : {-9.5, -1.0, 0.0, 3.3, 9.0})
    EXPECT_NEAR(c.output_volts(1, c.code(1, volts)), volts, 10.0 / 32768);
}

TEST_F(UnitTest, OutputCodesAreClampedNotWrapped) {
  const auto c = read_calibration(unit);
  EXPECT_EQ(c.code(0, 10), 65535);
  EXPECT_EQ(c.code(0, 1e300), 65535);
  EXPECT_EQ(c.code(0, -10), 0);
  EXPECT_EQ(c.code(0, -1e300), 0);
  EXPECT_EQ(c.code(0, 0), 32768);
  EXPECT_EQ(c.code(0, std::nan("")), 32768);
}

TEST_F(UnitTest, RefusesACalibrationThatCannotBeTrue) {
  for (const float slope : {0.F, 2.F, -1.F, std::nanf(""), INFINITY}) {
    calibrate(state, slope, 1e6F);
    try {
      read_calibration(unit);
      FAIL() << slope;
    } catch (const Error& error) {
      EXPECT_EQ(error.problems().size(), 12U);
      EXPECT_EQ(error.problems().at(0).path, "/eeprom/0x7000");
      EXPECT_EQ(error.problems().at(1).path, "/eeprom/0x7004");
      EXPECT_EQ(error.problems().at(8).path, "/eeprom/0x7080");
      EXPECT_FALSE(error.problems().at(0).given.is_null());
    }
  }
}

TEST(Fpga, IsTakenOnlyIfItIsTheKnownOne) {
  const auto& model = *find_model(vendor_id, 0x0112);
  const auto path = testing::TempDir() + "/image.rbf";
  const auto message = [&](const std::string& file) {
    try {
      read_fpga_image(file, model);
    } catch (const Error& error) {
      return std::string(error.what());
    }
    return std::string("taken");
  };
  const auto write = [&](std::size_t size) {
    std::FILE* file = std::fopen(path.c_str(), "wb");
    ASSERT_NE(file, nullptr);
    for (std::size_t i = 0; i < size; ++i) std::fputc(7, file);
    std::fclose(file);
  };
  EXPECT_THAT(message(""), HasSubstr("names none"));
  EXPECT_THAT(message(testing::TempDir() + "/none"), HasSubstr("cannot be read"));
  write(model.fpga_bytes - 1);
  EXPECT_THAT(message(path), HasSubstr("is too short"));
  write(model.fpga_bytes + 1);
  EXPECT_THAT(message(path), HasSubstr("is too long"));
  write(model.fpga_bytes);
  EXPECT_THAT(message(path), HasSubstr("has another SHA-256"));
  EXPECT_THAT(message(path), HasSubstr("github.com/mccdaq/uldaq"));
}

TEST_F(UnitTest, FpgaIsSentInPiecesOf64) {
  const std::vector<std::byte> image(150, std::byte{0x5A});
  unit.load_fpga(image);
  EXPECT_EQ(state.fpga_image, image);
  ASSERT_EQ(state.requests.size(), 4U);
  EXPECT_EQ(state.requests[0], "4050 00000000 ad");
  EXPECT_EQ(state.requests[3].size(), std::string("4051 00000000 ").size() + 2 * 22);
}

TEST_F(UnitTest, AnUnconfiguredUnitNeedsAnImage) {
  state.fpga = false;
  EXPECT_THROW(ensure_fpga(unit, ""), Error);
  state.fpga = true;
  EXPECT_FALSE(ensure_fpga(unit, ""));
}

}  // namespace
}  // namespace ferrobench::daq::usb

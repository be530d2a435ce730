#include "daq/usb/usb_device.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "daq/guard/guard.h"
#include "tests/daq/programs.h"
#include "tests/daq/usb/bench.h"

namespace ferrobench::daq::usb {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

const std::vector<LinearPiece> up_and_down{
    {.samples = 500, .level = 1e6}, {.samples = 300, .level = 1e6}, {.samples = 500, .level = 0}};
constexpr double per_code = 2e6 / 32768;  // V/m

// Row k is level k, as the monitor saw it.
void expect_followed(const Bench::Result& result) {
  ASSERT_EQ(result.rows, 1301U);
  for (std::size_t row = 0; row < 1301; ++row) {
    const double r = static_cast<double>(row);
    const double level = row < 500 ? r / 500 * 1e6 : row < 800 ? 1e6 : (1300 - r) / 500 * 1e6;
    ASSERT_NEAR(result.counts[3 * row] * per_code, level, per_code * 0.51) << row;
  }
}

TEST(UsbDevice, PlaysAndRecordsEveryRowAtAnyRate) {
  for (const double rate : {1000.0, 50.0, 20000.0, 125000.0}) {
    Bench bench;
    const auto result = bench.play(rate, up_and_down);
    EXPECT_EQ(result.status, BlockStatus::ok) << result.message;
    EXPECT_TRUE(result.in_order);
    expect_followed(result);
    // The second input counts ticks: none is lost, doubled or out of order.
    const auto n = pace_for(rate, 2000, 125e3).oversampling;
    for (std::size_t row = 0; row < result.rows; ++row)
      ASSERT_EQ(result.counts[3 * row + 1] + 32768, counter(row * n));
    EXPECT_EQ(bench.device().output(), 0);
    EXPECT_EQ(bench.state.output, 0x8000);
  }
}

TEST(UsbDevice, ACommonClockServesAsWell) {
  auto json = bench_json();
  json["start"] = {{"mode", "clock"}};
  Bench bench(json);
  const auto result = bench.play(1000, up_and_down);
  EXPECT_EQ(result.status, BlockStatus::ok) << result.message;
  expect_followed(result);
}

TEST(UsbDevice, PacketsMayEndAnywhere) {
  for (const std::size_t bytes : {7U, 13U, 510U}) {
    Bench bench;
    bench.state.odd_packets = bytes;
    const auto result = bench.play(1000, up_and_down);
    EXPECT_EQ(result.status, BlockStatus::ok) << result.message;
    expect_followed(result);
  }
}

TEST(UsbDevice, KeepsLittleAheadOfTheInput) {
  for (const double rate : {100.0, 1000.0, 20000.0, 125000.0}) {
    struct Endless final : LevelSource {
      LinearPiece next(std::uint64_t most) override {
        given += most;
        return {.samples = most};
      }
      std::atomic<std::uint64_t> given{0};
    } source;
    Bench bench;
    bench.device().start(bench.device().scan_rate(rate), source);
    SampleBlock block;
    std::uint64_t read = 0;
    while (read < rate) {
      ASSERT_TRUE(bench.device().read(block));
      ASSERT_EQ(block.status, BlockStatus::ok) << block.message;
      read += block.rows;
    }
    bench.device().go_to(0, 1e6);
    // Codes sent and not played when the stream ended, in seconds.
    const double tick_rate = bench.device().info().at("tick_rate");
    EXPECT_EQ(bench.device().output(), 0);
    const double n = bench.device().info().at("oversampling");
    const double sent = static_cast<double>(source.given) * n;
    EXPECT_LE((sent - static_cast<double>(bench.state.played.size())) / tick_rate, 0.1 + 1 / rate) << rate;
  }
}

// Whatever is wrong, the guard ends the run with a fault, and the output is at zero if the unit still
// answers.
struct Fault {
  const char* name;
  void (*set)(FakeState&);
  BlockStatus status;
  const char* words;
  bool answers = true;
};

class UsbFault : public testing::TestWithParam<Fault> {};

TEST_P(UsbFault, IsTypedAndTheOutputGoesToZero) {
  const auto& fault = GetParam();
  Bench bench;
  auto& device = bench.device();
  fault.set(bench.state);
  Guard guard(device, Limits{});
  BlockStatus status = BlockStatus::ok;
  std::string message;
  std::uint64_t rows = 0;
  try {
    guard.start(program({line(0, 1e6, 0.5), line(1e6, 1e6, 0.3), line(1e6, 0, 0.5)}, device.scan_rate(1000)));
    for (SampleBlock block; guard.read(block);) {
      // Rows that were handed on are right.
      for (std::size_t i = 0; i < block.rows; ++i)
        ASSERT_NEAR(block.counts[3 * i] * per_code, block.command[i], per_code) << block.first_sample + i;
      rows += block.rows;
      if (block.status == BlockStatus::ok) continue;
      status = block.status;
      message = block.message;
    }
  } catch (const Error& error) {
    message = error.what();
    status = fault.status;
  }
  EXPECT_EQ(status, fault.status) << message;
  EXPECT_THAT(message, HasSubstr(fault.words));
  EXPECT_EQ(guard.outcome().end, End::fault);
  EXPECT_LT(rows, 1301U);
  EXPECT_EQ(guard.outcome().output_at_zero, fault.answers);
  if (fault.answers) {
    EXPECT_EQ(bench.state.output, 0x8000);
    // And the next run works.
    bench.state.overrun_at = bench.state.rotate_at = bench.state.stall_at = bench.state.silent_at = -1;
    bench.state.rotation = 0;
    bench.state.starve_output = false;
    bench.state.wired = true;
    bench.state.monitor = true;
    bench.state.refuse = {};
    const auto result = bench.play(1000, up_and_down);
    EXPECT_EQ(result.status, BlockStatus::ok) << result.message;
    expect_followed(result);
  } else {
    EXPECT_FALSE(device.output() == 0);
    EXPECT_EQ(device.info().at("link_speed"), "high") << "what it was is still known";
    EXPECT_EQ(device.scan_rate(1000), 1000);
    // Plugged in again, it is found again.
    bench.state.gone = false;
    bench.state.unplug_at = -1;
    device.go_to(0, 1e6);
    const auto result = bench.play(1000, up_and_down);
    EXPECT_EQ(result.status, BlockStatus::ok) << result.message;
    expect_followed(result);
  }
}

INSTANTIATE_TEST_SUITE_P(
    All, UsbFault,
    testing::Values(
        Fault{"overrun", [](FakeState& s) { s.overrun_at = 777; }, BlockStatus::timeout, "overran"},
        Fault{"rotated", [](FakeState& s) { s.rotation = 1; }, BlockStatus::misaligned, "are rotated"},
        Fault{"slipped", [](FakeState& s) { s.rotate_at = 1000; }, BlockStatus::misaligned, "marker"},
        Fault{"stalled", [](FakeState& s) { s.stall_at = 500; }, BlockStatus::stall, "stall"},
        Fault{"silent", [](FakeState& s) { s.silent_at = 900; }, BlockStatus::timeout, "stopped sending"},
        Fault{"unwired", [](FakeState& s) { s.wired = false; }, BlockStatus::stall, "DIO0 to TRIG"},
        Fault{"starved", [](FakeState& s) { s.starve_output = true; }, BlockStatus::underrun, "output"},
        Fault{"amplifier off", [](FakeState& s) { s.monitor = false; }, BlockStatus::misaligned,
              "monitor shows"},
        Fault{"start refused",
              [](FakeState& s) {
                s.refuse = [](const std::string& r) {
                  return r.starts_with("401a") ? LinkStatus::stall : LinkStatus::ok;
                };
              },
              BlockStatus::stall, "start of the output scan"},
        Fault{"queue refused",
              [](FakeState& s) {
                s.refuse = [](const std::string& r) {
                  return r.starts_with("4014") ? LinkStatus::timeout : LinkStatus::ok;
                };
              },
              BlockStatus::timeout, "input queue"},
        Fault{"unplugged", [](FakeState& s) { s.unplug_at = 700; }, BlockStatus::device_lost, "no device",
              false}),
    [](const auto& test) {
      std::string name = test.param.name;
      std::replace(name.begin(), name.end(), ' ', '_');
      return name;
    });

TEST(UsbDevice, AnyRequestMayFailOnceOrForeverAtTheStart) {
  // How many requests a run of this kind makes.
  Bench whole;
  whole.play(1000, up_and_down);
  const auto count = whole.state.requests.size();
  for (const bool forever : {false, true}) {
    for (std::size_t at = 0; at < count; at += forever ? 5 : 1) {
      Bench bench;
      std::size_t call = 0;
      bench.state.refuse = [&](const std::string&) {
        const bool now = forever ? call >= at : call == at;
        ++call;
        return now ? LinkStatus::timeout : LinkStatus::ok;
      };
      Bench::Result result;
      try {
        result = bench.play(1000, up_and_down);
      } catch (const Error& error) {
        EXPECT_NE(std::string(error.what()), "");
        result.status = BlockStatus::device_lost;
      }
      if (result.rows == 1301 && result.status == BlockStatus::ok) expect_followed(result);
      if (forever) {
        EXPECT_NE(result.status, BlockStatus::ok) << at;
        testing::internal::CaptureStderr();
        bench.close();
        testing::internal::GetCapturedStderr();
        continue;
      }
      bench.state.refuse = {};
      bench.device().go_to(0, 1e7);
      EXPECT_EQ(bench.state.output, 0x8000);
      EXPECT_EQ(bench.device().output(), 0);
    }
  }
}

TEST(UsbDevice, GoesInBoundedSteps) {
  Bench bench;
  bench.device();
  bench.state.written.clear();
  const auto before = bench.state.clock.now();
  bench.device().go_to(1e6, 2e6);
  const double took = std::chrono::duration<double>(bench.state.clock.now() - before).count();
  EXPECT_NEAR(took, 0.5, 0.01);
  EXPECT_EQ(bench.device().output(), 1e6);
  EXPECT_EQ(bench.state.output, 32768 + 16384);
  int last = 32768;
  for (const int code : bench.state.written) {
    EXPECT_GE(code, last);
    EXPECT_LE((code - last) * per_code, 2e6 * 0.001 + per_code);
    last = code;
  }
}

TEST(UsbDevice, BringsAVoltageThatItFindsToZeroSlowly) {
  Bench bench;
  bench.state.output = 65535;
  bench.device();
  EXPECT_EQ(bench.state.output, 0x8000);
  EXPECT_GT(bench.state.written.size(), 900U);
  EXPECT_EQ(bench.device().output(), 0);
}

TEST(UsbDevice, SaysOnStandardErrorThatZeroWasNotReached) {
  Bench bench;
  bench.device().go_to(5e5, 1e7);
  bench.state.gone = true;
  testing::internal::CaptureStderr();
  bench.close();
  EXPECT_THAT(testing::internal::GetCapturedStderr(), HasSubstr("may not be at zero"));
}

std::string failure_of(const std::function<void()>& act) {
  try {
    act();
  } catch (const Error& error) {
    return error.what();
  }
  return {};
}

LinkStatus no_output_value(const std::string& request) {
  return request.starts_with("4018") ? LinkStatus::timeout : LinkStatus::ok;
}

TEST(UsbDevice, WhoeverOpensItIsToldThatZeroWasNotReached) {
  const auto words = HasSubstr("the output may not be at zero, switch the amplifier off");
  {
    Bench bench;
    bench.state.output = 65535;
    bench.state.refuse = no_output_value;
    EXPECT_THAT(failure_of([&] { bench.device(); }),
                AllOf(words, HasSubstr("01ABCDEF"), HasSubstr("output value")));
  }
  {
    Bench bench;
    calibrate(bench.state, 7);
    EXPECT_THAT(failure_of([&] { bench.device(); }), AllOf(words, HasSubstr("calibration")));
  }
  Bench bench;  // has just got its power: there is no output yet
  bench.state.fpga = false;
  EXPECT_THAT(failure_of([&] { bench.device(); }), AllOf(HasSubstr("FPGA image"), Not(words)));
}

TEST(UsbDevice, TheEnableLineFallsWhereTheOutputDoesNotGoToZero) {
  auto json = bench_json();
  json["amplifier"]["enable_bit"] = 5;
  Bench bench(json);
  auto& device = bench.device();
  device.go_to(1e6, 1e7);
  EXPECT_EQ(bench.state.latch, 0x20);
  bench.state.refuse = no_output_value;
  EXPECT_NE(failure_of([&] { device.go_to(0, 1e7); }), "");
  EXPECT_EQ(bench.state.latch, 0);
  bench.state.refuse = {};
  device.go_to(0, 1e7);
  EXPECT_EQ(device.output(), 0);
}

TEST(UsbDevice, RefusesEndpointsThatAreNotAUnits) {
  for (const auto& [input, output] :
       {std::pair<std::size_t, std::size_t>{0, 512}, {512, 0}, {512, 64}, {1024, 1024}}) {
    Bench bench;
    bench.state.packet = input;
    bench.state.output_packet = output;
    EXPECT_THAT(failure_of([&] { bench.device(); }), HasSubstr("endpoint")) << input << ' ' << output;
  }
}

TEST(UsbDevice, SwitchesTheAmplifierOnForARunAndOffAtTheEnd) {
  auto json = bench_json();
  json["amplifier"]["enable_bit"] = 5;
  json["amplifier"]["interlock_bit"] = 6;
  Bench bench(json);
  bench.device();
  EXPECT_EQ(bench.state.latch, 0);
  EXPECT_EQ(bench.state.inputs_mask, 0xFF & ~0x21);
  const auto result = bench.play(1000, up_and_down);
  EXPECT_EQ(result.status, BlockStatus::ok) << result.message;
  EXPECT_EQ(bench.state.latch & 0x20, 0x20);
  EXPECT_TRUE(bench.device().interlock_closed());
  bench.state.pins = 0xBF;
  EXPECT_FALSE(bench.device().interlock_closed());
  bench.close();
  EXPECT_EQ(bench.state.latch, 0);
}

TEST(UsbDevice, AnOpenInterlockLineEndsTheRunAtZero) {
  auto json = bench_json();
  json["amplifier"]["interlock_bit"] = 6;
  Bench bench(json);
  auto& device = bench.device();
  {
    bench.state.clock.real = true;
    Guard guard(device, Limits{});
    guard.start(program({line(0, 1e6, 0.5), line(1e6, 1e6, 60)}, device.scan_rate(1000)));
    SampleBlock block;
    ASSERT_TRUE(guard.read(block));
    bench.state.pins = 0;
    while (guard.read(block)) {
    }
    EXPECT_EQ(guard.outcome().end, End::interlock) << guard.outcome().reason;
    EXPECT_TRUE(guard.outcome().output_at_zero);
    EXPECT_EQ(bench.state.output, 0x8000);
  }
  Guard guard(device, Limits{});
  EXPECT_THROW(guard.go_to(1e5, 1e6), Error);
}

TEST(UsbDevice, RefusesProductsWithoutOutputs) {
  for (const std::uint16_t product : {0x0110, 0x0111, 0x0134, 0x0135}) {
    Bench bench;
    bench.state.product = product;
    try {
      bench.device();
      FAIL();
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::device_unavailable);
      EXPECT_THAT(error.what(), HasSubstr("no analog output"));
    }
  }
}

TEST(UsbDevice, SaysWhatItIsAndWhatItCan) {
  auto json = bench_json();
  json["displacement"]["gain_uncertainty"] = 0.005;
  Bench bench(json);
  const auto info = bench.device().info();
  EXPECT_EQ(info.at("serial_number"), "01ABCDEF");
  EXPECT_DOUBLE_EQ(info.at("channels").at(2).at("skew_s"), 2 / 500e3);
  EXPECT_DOUBLE_EQ(info.at("channels").at(2).at("gain_uncertainty"), 0.005);
  EXPECT_FALSE(info.at("channels").at(1).contains("gain_uncertainty"));
  EXPECT_THROW(bench.device().scan_rate(0.5), Error);
  EXPECT_THROW(bench.device().scan_rate(125001), Error);
  EXPECT_EQ(bench.device().scan_rate(125000), 125000);
  EXPECT_EQ(bench.device().specimen()->layer_thickness, 1e-4);
}

}  // namespace
}  // namespace ferrobench::daq::usb

// A whole experiment through USB against the same on the virtual device: model, sensors and noise are the
// same, between them lie amplifier, converters, FIFOs and bus.
#include <gtest/gtest.h>

#include <cmath>

#include "boards/virtual_bench.h"
#include "daq/selftest.h"
#include "daq/virtual/virtual_device.h"
#include "rig.h"
#include "tests/daq/programs.h"

namespace ferrobench::emulator {
namespace {

using daq::line;

constexpr double rate = 1000;  // rows/s

BenchConfig bench_config() {
  BenchConfig config;
  config.specimen.model = "soft-pzt";
  config.specimen.domains = 50;
  config.specimen.tolerance = 1e-6;  // a ramp and its steps differ by the error in time
  config.fresh = true;
  return config;
}

std::vector<protocols::Piece> loops() {
  constexpr double top = 1.5e6;
  return {line(0, top, 0.5), line(top, -top / 10, 0.6), line(-top / 10, top / 2, 0.3),
          line(top / 2, top / 2, 0.5), line(top / 2, 0, 0.3)};
}

// By column, row after row, in SI.
std::vector<std::vector<double>> record(daq::Device& device) {
  daq::Guard guard(device, daq::Limits{});
  guard.start(daq::program(loops(), device.scan_rate(rate)));
  const auto columns = device.columns();
  std::vector<std::vector<double>> out(columns.size());
  for (daq::SampleBlock block; guard.read(block);)
    for (std::size_t i = 0; i < block.counts.size(); ++i)
      out[i % columns.size()].push_back(columns[i % columns.size()].offset +
                                        columns[i % columns.size()].gain * block.counts[i]);
  EXPECT_EQ(guard.outcome().end, daq::End::complete) << guard.outcome().reason;
  EXPECT_TRUE(guard.outcome().output_at_zero);
  return out;
}

TEST(DriverBench, MeasuresWhatTheVirtualDeviceMeasures) {
  const auto config = bench_config();
  VirtualBench board(config);
  Rig rig(device_config(config), board);
  const auto through_usb = record(rig.device());
  EXPECT_NEAR(rig.output_volts(), 0, 0.5e-3);
  board.input(rig.unit.now(), {});
  EXPECT_NEAR(board.amplifier_voltage(), 0, config.amplifier_gain * 0.5e-3);

  daq::VirtualConfig specimen = config.specimen;
  specimen.clock = daq::Clock::fast;
  specimen.field_range = config.amplifier_range / board.model().actuator.layer_thickness;
  daq::VirtualDevice device(board.model(), specimen);
  const auto direct = record(device);

  ASSERT_EQ(through_usb.size(), 4U);
  ASSERT_EQ(direct.size(), through_usb.size());
  const auto noise = rig.device().noise();
  const auto columns = rig.device().columns();
  for (std::size_t c = 0; c < direct.size(); ++c) {
    ASSERT_EQ(through_usb[c].size(), direct[c].size());
    const double sigma = noise.at(static_cast<std::size_t>(columns[c].channel)).value();
    // A virgin specimen creeps while it waits for its first field; only the bench on USB has made it wait.
    const std::size_t first = static_cast<std::size_t>(0.5 * rate);
    const auto [low, high] = std::minmax_element(direct[c].begin(), direct[c].end());
    double sum = 0, squares = 0;
    for (std::size_t i = first; i < direct[c].size(); ++i) {
      const double difference = through_usb[c][i] - direct[c][i];
      sum += difference;
      squares += difference * difference;
    }
    const auto n = static_cast<double>(direct[c].size() - first);
    // Noise of both, a step of the output instead of a ramp, channels a few microseconds apart.
    const double systematic = 5e-4 * (*high - *low);
    EXPECT_LT(std::sqrt(squares / n), std::sqrt(2.0) * 1.2 * sigma + systematic) << c;
    EXPECT_LT(std::abs(sum / n), 5 * std::sqrt(2 / n) * sigma + systematic) << c;
  }
}

TEST(DriverBench, PassesTheSelftest) {
  const auto config = bench_config();
  VirtualBench board(config);
  Rig rig(device_config(config), board);
  const auto report = daq::selftest(rig.device());
  EXPECT_GE(report.rows.size(), 7U);
  for (const auto& row : report.rows) {
    if (row.quantity == "rate") continue;  // the unit's time is not the host's here
    EXPECT_TRUE(row.passed) << row.quantity << ": " << row.measured;
  }
  EXPECT_NEAR(rig.output_volts(), 0, 0.5e-3);
}

TEST(DriverBench, TheEnableLineAndTheInterlockAreTheBenchs) {
  auto config = bench_config();
  config.enable_line = 4;
  config.interlock_line = 5;
  VirtualBench board(config);
  Rig rig(device_config(config), board);
  auto& device = rig.device();
  EXPECT_TRUE(device.interlock_closed());
  device.go_to(1e6, 1e7);
  rig.clock.sleep_for(std::chrono::milliseconds(2));
  board.input(rig.unit.now(), {});
  EXPECT_NEAR(board.amplifier_voltage(), 100, 0.01);
  board.set_interlock(rig.unit.now(), false);
  EXPECT_FALSE(device.interlock_closed());
  rig.close();
  rig.clock.sleep_for(std::chrono::milliseconds(2));
  board.set_interlock(rig.unit.now(), true);
  rig.clock.sleep_for(std::chrono::milliseconds(2));
  board.input(rig.unit.now(), {});
  EXPECT_EQ(board.amplifier_voltage(), 0) << "closing the device drops the enable line";
}

}  // namespace
}  // namespace ferrobench::emulator

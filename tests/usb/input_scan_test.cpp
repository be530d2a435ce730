// The analog input scan against the protocol note, sections 3, 4 and 6.
#include <gtest/gtest.h>

#include <numeric>

#include "client.h"

namespace ferrobench::emulator {
namespace {

using enum Outcome;

void start(Client& client, const InputOrder& order, const Bytes& queue) {
  EXPECT_EQ(client.write(request::queue, 0, 0, queue), ok);
  EXPECT_TRUE(client.clear_halt(input_endpoint));
  EXPECT_EQ(client.write(request::input_clear), ok);
  EXPECT_EQ(client.write(request::input_start, 0, 0, input_order(order)), ok);
}

std::vector<std::uint16_t> pattern(std::uint64_t first, std::size_t count) {
  std::vector<std::uint16_t> out(count);
  for (std::size_t i = 0; i < count; ++i) out[i] = PatternBoard::code(first + i);
  return out;
}

TEST(InputScan, DataComeInQueueOrderWithBothLengthsOfStart) {
  for (const std::size_t length : {14U, 15U}) {
    Client client(Client::perfect());
    for (unsigned c = 0; c < 8; ++c) client.loopback.jumpers.at(c).level = c;
    start(client, {.scans = 3, .period = 63999, .length = length}, queue_of({5, 1, 1, 7}));
    const auto code = [](double volts) {
      return static_cast<std::uint16_t>(std::lround(32768 + volts * 3276.8));
    };
    std::vector<std::uint16_t> expected;
    for (int i = 0; i < 3; ++i)
      for (const double volts : {5.0, 1.0, 1.0, 7.0}) expected.push_back(code(volts));
    EXPECT_EQ(client.collect(0.01), expected);
    EXPECT_EQ(client.status(), status_bit::fpga_configured | status_bit::input_done);
  }
}

TEST(InputScan, TheQueueStaysWhileAScanRuns) {
  Client client;
  start(client, {.period = 63999}, queue_of({0, 1}));
  EXPECT_EQ(client.write(request::queue, 0, 0, queue_of({2})), stall);
  EXPECT_FALSE(client.read(request::queue, 16));
  EXPECT_FALSE(client.read(request::input_value, 2, 0));
  client.write(request::input_stop);
  EXPECT_EQ(client.read(request::queue, 16), queue_of({0, 1}));
}

TEST(InputScan, ATickIsAWholeScanAtTheRateOfThePeriod) {
  PatternBoard board;
  Client client(Client::perfect(), &board);
  start(client, {.period = 639, .options = input_option::burst},
        queue_of({0, 1, 2, 3}));  // 100 kS/s a channel
  const auto samples = client.collect(0.1, 64, 512);
  EXPECT_NEAR(static_cast<double>(samples.size()), 4 * 100e3 * 0.1, 256 + 4);
  EXPECT_EQ(samples, pattern(0, samples.size()));
  const auto counts = client.read(request::counter, 8);
  EXPECT_NEAR(get32(*counts), 100e3 * 0.1, 1) << "edges of the clock output";
}

TEST(InputScan, BurstConvertsBackToBackAndOtherwiseSpreads) {
  // A board that tells when each conversion was.
  struct Times final : Board {
    std::vector<Ticks> at;
    void output(Ticks, unsigned, double) override {}
    double input(Ticks time, const AnalogInput&) override { return at.push_back(time), 0.0; }
  };
  for (const bool burst : {false, true}) {
    Times times;
    Client client(Client::perfect(), &times);
    start(client, {.scans = 2, .period = 63999, .options = burst ? input_option::burst : 0U},
          queue_of({0, 1, 2, 3}));
    client.pass(0.005);
    ASSERT_EQ(times.at.size(), 8U);
    for (std::size_t i = 0; i < 8; ++i)
      EXPECT_EQ(times.at[i], i / 4 * 64000 + i % 4 * (burst ? 128 : 16000)) << i;
  }
}

class FiniteScan : public testing::TestWithParam<std::uint32_t> {};

TEST_P(FiniteScan, EndsWithAShortPacketOrAnEmptyOne) {
  PatternBoard board;
  Client client(Client::perfect(), &board);
  const std::uint32_t scans = GetParam();
  const std::size_t bytes = 2UL * scans;
  start(client, {.scans = scans, .period = 639}, queue_of({0}));
  // Longer than all the data: only the end of the scan can end this transfer.
  client.port.submit_in(1, input_endpoint, (bytes / 512 + 2) * 512);
  client.pass(static_cast<double>(scans) * 1e-5 + 0.001);
  const auto finished = client.port.take_finished();
  ASSERT_EQ(finished.size(), 1U);
  EXPECT_EQ(finished[0].outcome, ok);
  EXPECT_EQ(finished[0].moved, bytes);
  client.port.submit_in(2, input_endpoint, 512);
  client.pass(0.001);
  EXPECT_TRUE(client.port.take_finished().empty()) << "nothing comes after the end";
}

INSTANTIATE_TEST_SUITE_P(ProtocolNote4, FiniteScan, testing::Values(1, 255, 256, 257, 511, 512, 1024, 2000));

TEST(InputScan, AnExactMultipleThatFillsItsTransferStillSendsTheEmptyPacket) {
  Client client;
  start(client, {.scans = 512, .period = 639}, queue_of({0}));
  client.port.submit_in(1, input_endpoint, 1024);
  client.port.submit_in(2, input_endpoint, 1024);
  client.pass(0.01);
  const auto finished = client.port.take_finished();
  ASSERT_EQ(finished.size(), 2U);
  EXPECT_EQ(finished[0].moved, 1024U);
  EXPECT_EQ(finished[1].moved, 0U);
  EXPECT_EQ(finished[1].outcome, ok);
}

TEST(InputScan, SmallPacketsEndTheTransfer) {
  Client client;
  start(client, {.period = 63999, .packet_size = 3}, queue_of({0, 1, 2, 3}));
  for (std::uint64_t id = 0; id < 3; ++id) client.port.submit_in(id, input_endpoint, 512);
  client.pass(0.0035);
  const auto finished = client.port.take_finished();
  ASSERT_EQ(finished.size(), 3U);
  for (const auto& f : finished) EXPECT_EQ(f.moved, 8U);
}

TEST(InputScan, AFullFifoIsAnOverrunThatEndsTheStream) {
  PatternBoard board;
  Client client(Client::perfect(), &board);
  start(client, {.period = 639}, queue_of({0}));
  client.pass(4000 * 1e-5);
  EXPECT_EQ(client.status() & (status_bit::overrun | status_bit::input_running), status_bit::input_running);
  client.pass(200 * 1e-5);
  EXPECT_EQ(client.status() & (status_bit::overrun | status_bit::input_running), status_bit::overrun);
  EXPECT_EQ(client.collect(0.05), pattern(0, 4096)) << "8 KiB";
  client.write(request::input_clear);
  EXPECT_EQ(client.status() & status_bit::overrun, 0);
}

TEST(InputScan, APacerTooFastForItsChannelsOverruns) {
  Client client;
  start(client, {.period = period_of(125e3), .options = input_option::burst}, queue_of({0, 1, 2, 3}));
  client.collect(0.01);
  EXPECT_EQ(client.status() & status_bit::overrun, 0) << "500 kS/s over all channels is allowed";
  client.write(request::input_stop);
  start(client, {.period = period_of(130e3), .options = input_option::burst}, queue_of({0, 1, 2, 3}));
  client.collect(0.01);
  EXPECT_NE(client.status() & status_bit::overrun, 0);
}

TEST(InputScan, WaitsForItsTriggerInEveryMode) {
  for (unsigned mode = 0; mode < 4; ++mode) {
    const bool active = (mode & 2U) != 0;
    Client client(Client::perfect());
    client.unit.set_trigger_pin(!active);
    client.write(request::trigger, 0, 0, bytes_of({mode}));
    start(client, {.scans = 10, .period = 6399, .options = input_option::trigger}, queue_of({0}));
    EXPECT_EQ(client.collect(0.01).size(), 0U) << mode;
    EXPECT_NE(client.status() & status_bit::input_running, 0);
    client.unit.set_trigger_pin(active);
    EXPECT_EQ(client.collect(0.01).size(), 10U) << mode;
    client.write(request::input_stop);
    // Already active: enough for a level, not for an edge.
    start(client, {.scans = 10, .period = 6399, .options = input_option::trigger}, queue_of({0}));
    EXPECT_EQ(client.collect(0.01).size(), (mode & 1U) != 0 ? 0U : 10U) << mode;
  }
}

TEST(InputScan, RetriggersAfterSoManyScans) {
  Client client;
  client.write(request::trigger, 0, 0, bytes_of({3}));
  start(client,
        {.scans = 30,
         .per_trigger = 10,
         .period = 6399,
         .packet_size = 0,
         .options = input_option::retrigger | input_option::trigger},
        queue_of({0}));
  for (int i = 0; i < 3; ++i) {
    client.unit.set_trigger_pin(true);
    EXPECT_EQ(client.collect(0.01).size(), 10U);
    client.unit.set_trigger_pin(false);
  }
  EXPECT_NE(client.status() & status_bit::input_done, 0);
}

TEST(InputScan, AnExternalClockIsAScanWithBurstAndAConversionWithout) {
  for (const bool burst : {true, false}) {
    UnitSetup setup = Client::perfect();
    setup.wiring.input_clock = ClockSource::timer;
    Client client(setup);
    start(client, {.scans = 8, .period = 0, .packet_size = 0, .options = burst ? input_option::burst : 0U},
          queue_of({0, 1, 2, 3}));
    Bytes parameters;
    for (const unsigned v : {6399U, 99U, 8U, 0U}) append32(parameters, v);
    client.write(request::timer_parameters, 0, 0, parameters);
    client.write(request::timer_control, 1);
    EXPECT_EQ(client.collect(0.01, 64, 512).size(), burst ? 32U : 8U);
  }
}

TEST(InputScan, InternalSourcesAreConvertedInModeThree) {
  UnitSetup setup = Client::perfect();
  setup.internal_sources[4] = 2.5;
  Client client(setup);
  client.write(request::calibration_source, 0, 0, bytes_of({4}));
  Bytes queue(16);
  queue[0] = std::byte{0x80 | 3 << 5};
  start(client, {.scans = 2, .period = 6399}, queue);
  EXPECT_EQ(client.collect(0.005), (std::vector<std::uint16_t>(2, 32768 + 8192)));
}

TEST(InputScan, ATransferTooSmallForThePacketBabbles) {
  Client client;
  start(client, {.period = 639}, queue_of({0}));
  client.port.submit_in(1, input_endpoint, 100);
  client.pass(0.01);
  ASSERT_EQ(client.port.take_finished().at(0).outcome, babble);
}

TEST(InputScan, AHundredThousandScansAtFullRateLoseNothing) {
  PatternBoard board((1ULL << 31) - 200'000);
  Client client(Client::perfect(), &board);
  start(client, {.scans = 100'000, .period = 511, .options = input_option::burst}, queue_of({0, 1, 2, 3}));
  const auto samples = client.collect(0.85);
  EXPECT_EQ(samples, pattern((1ULL << 31) - 200'000, 400'000)) << "and the count passes 2^31";
}

}  // namespace
}  // namespace ferrobench::emulator

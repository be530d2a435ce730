// The analog output scan against the protocol note, sections 5, 6 and 9.
#include <gtest/gtest.h>

#include "client.h"

namespace ferrobench::emulator {
namespace {

using enum Outcome;

// A board that keeps what came to its terminals, and loops the first output back.
struct Recorder final : Board {
  std::vector<std::pair<Ticks, double>> updates;
  std::array<double, 2> volts{};
  void output(Ticks time, unsigned channel, double v) override {
    volts.at(channel) = v;
    if (channel == 0) updates.emplace_back(time, v);
  }
  double input(Ticks, const AnalogInput&) override { return volts[0]; }
};

std::uint16_t code(double volts) {
  return static_cast<std::uint16_t>(std::lround(32768 + volts * 3276.8));
}

std::vector<std::uint16_t> ramp(std::size_t count) {
  std::vector<std::uint16_t> out(count);
  for (std::size_t i = 0; i < count; ++i) out[i] = static_cast<std::uint16_t>(32768 + i);
  return out;
}

// One public driver sends the 13 bytes that count, another one its structure with the 3 that pad it.
TEST(OutputScan, TakesBothLengthsOfStart) {
  for (const std::size_t length : {13U, 16U}) {
    Recorder board;
    Client client(Client::perfect(), &board);
    board.updates.clear();
    client.port.submit_out(1, output_endpoint, samples_of(ramp(100)));
    auto order = output_order(100, 0, 6399, 1);
    order.resize(length, std::byte{0xEE});
    EXPECT_EQ(client.write(request::output_start, 0, 0, order), ok) << length;
    client.pass(0.02);
    EXPECT_EQ(board.updates.size(), 100U) << length;
  }
  for (const std::size_t length : {12U, 14U, 17U}) {
    Client client;
    auto order = output_order(100, 0, 6399, 1);
    order.resize(length);
    EXPECT_EQ(client.write(request::output_start, 0, 0, order), stall) << length;
  }
}

TEST(OutputScan, PlaysWhatWasSentBeforeStartAtItsRateAndKeepsTheLastValue) {
  Recorder board;
  Client client(Client::perfect(), &board);
  board.updates.clear();
  client.port.submit_out(1, output_endpoint, samples_of(ramp(100)));
  client.pass(0.001);
  EXPECT_EQ(client.port.take_finished().at(0).outcome, ok) << "taken before START";
  EXPECT_EQ(client.write(request::output_start, 0, 0, output_order(100, 0, 6399, 1)), ok);
  const Ticks begin = client.port.now();
  EXPECT_EQ(client.write(request::output_value, 0, 0), stall) << "while the scan runs";
  EXPECT_EQ(client.write(request::output_start, 0, 0, output_order(100, 0, 6399, 1)), stall);
  client.pass(0.02);
  ASSERT_EQ(board.updates.size(), 100U);
  for (std::size_t i = 0; i < 100; ++i) {
    EXPECT_EQ(board.updates[i].first, begin + 6400 * i + client.unit.setup().output_settling);
    EXPECT_EQ(code(board.updates[i].second), 32768 + i);
  }
  EXPECT_EQ(client.status(), status_bit::fpga_configured | status_bit::output_done);
  EXPECT_EQ(code(board.volts[0]), 32768 + 99);
  EXPECT_EQ(client.write(request::output_value, 0x8000, 0), ok);
}

TEST(OutputScan, LowChannelFirst) {
  for (const unsigned mask : {1U, 2U, 3U}) {
    Client client(Client::perfect());
    client.port.submit_out(1, output_endpoint, samples_of(std::array{code(1), code(2)}));
    client.write(request::output_start, 0, 0, output_order(1, 0, 6399, mask));
    client.pass(0.001);
    EXPECT_NEAR(client.loopback.output_voltage(0), mask == 2 ? 0 : 1, 1e-3) << mask;
    EXPECT_NEAR(client.loopback.output_voltage(1), mask == 1 ? 0 : mask == 2 ? 1 : 2, 1e-3) << mask;
  }
  Client client;
  EXPECT_EQ(client.write(request::output_start, 0, 0, output_order(1, 0, 6399, 0)), stall);
}

TEST(OutputScan, TakesNoMoreThanItsFifoHolds) {
  Client client;
  client.port.submit_out(1, output_endpoint, samples_of(ramp(2048)));
  client.port.submit_out(2, output_endpoint, samples_of(ramp(256)));
  client.pass(0.1);
  EXPECT_EQ(client.port.take_finished().size(), 1U) << "2048 samples, the rest is not taken";
  client.write(request::output_clear);
  client.pass(0.001);
  EXPECT_EQ(client.port.take_finished().size(), 1U);
}

TEST(OutputScan, StartedEmptyItWaitsForItsFirstData) {
  Recorder board;
  Client client(Client::perfect(), &board);
  board.updates.clear();
  client.write(request::output_start, 0, 0, output_order(3, 0, 6399, 1));
  client.pass(0.1);
  EXPECT_EQ(client.status() & (status_bit::output_running | status_bit::underrun),
            status_bit::output_running);
  EXPECT_TRUE(board.updates.empty());
  client.port.submit_out(1, output_endpoint, samples_of(ramp(3)));
  client.pass(0.001);
  ASSERT_EQ(board.updates.size(), 3U);
  EXPECT_EQ(board.updates[2].first - board.updates[0].first, 2U * 6400);
}

TEST(OutputScan, RunningDryIsAnUnderrunThatKeepsTheLastValue) {
  Client client(Client::perfect());
  client.port.submit_out(1, output_endpoint, samples_of(ramp(10)));
  client.write(request::output_start, 0, 0, output_order(0, 0, 6399, 1));
  client.pass(9.5e-4);
  EXPECT_EQ(client.status() & status_bit::underrun, 0);
  client.pass(1e-3);
  EXPECT_EQ(client.status() & (status_bit::underrun | status_bit::output_running), status_bit::underrun);
  EXPECT_EQ(code(client.loopback.output_voltage(0)), 32768 + 9);
  client.write(request::output_clear);
  EXPECT_EQ(client.status() & status_bit::underrun, 0);
}

TEST(OutputScan, ContinuousAtFullRateWithTransfersInTurn) {
  Recorder board;
  Client client(Client::perfect(), &board);
  board.updates.clear();
  constexpr std::size_t total = 60'000;
  const auto samples = ramp(total);
  std::size_t sent = 0;
  std::uint64_t id = 1;
  const auto feed = [&] {
    while (sent < total && client.port.under_way() < 4) {
      const std::size_t n = std::min<std::size_t>(2048, total - sent);
      client.port.submit_out(id++, output_endpoint, samples_of(std::span(samples).subspan(sent, n)));
      sent += n;
    }
  };
  feed();
  client.write(request::output_start, 0, 0, output_order(total, 0, 127, 1));  // 500 kS/s
  for (int i = 0; i < 150; ++i) {
    client.pass(1e-3);
    feed();
  }
  EXPECT_EQ(client.status() & (status_bit::underrun | status_bit::output_done), status_bit::output_done);
  ASSERT_EQ(board.updates.size(), total);
  for (std::size_t i = 0; i < total; ++i) ASSERT_EQ(code(board.updates[i].second), samples[i]) << i;
}

// Input and output armed, one edge of DIO0 jumpered to TRIG starts both (protocol note 9, way 1).
TEST(OutputScan, StartsWithTheInputOnACommonTrigger) {
  UnitSetup setup = Client::perfect();
  setup.wiring.trigger = TriggerSource::dio0;
  Client client(setup);
  client.loopback.jumpers[0].output = 0;
  client.write(request::latch, 0);
  client.write(request::tristate, 0xFE);
  client.write(request::trigger, 0, 0, bytes_of({3}));
  client.write(request::queue, 0, 0, queue_of({0}));
  client.port.submit_out(1, output_endpoint, samples_of(ramp(200)));
  client.write(request::output_start, 0, 0, output_order(200, 0, 6399, 1 | output_option::trigger));
  client.pass(0.003);
  client.write(request::input_start, 0, 0,
               input_order({.scans = 201, .period = 6399, .options = input_option::trigger}));
  EXPECT_EQ(client.collect(0.01).size(), 0U);
  client.write(request::latch, 1);
  const auto samples = client.collect(0.03);
  ASSERT_EQ(samples.size(), 201U);
  EXPECT_EQ(samples[0], 32768) << "the update of the same tick has not settled";
  for (std::size_t i = 0; i < 200; ++i) ASSERT_EQ(samples[i + 1], 32768 + i) << i;
}

// One scan per update of the output (protocol note 9, way 2).
TEST(OutputScan, ClocksTheInput) {
  UnitSetup setup = Client::perfect();
  setup.wiring.input_clock = ClockSource::output_clock_out;
  Client client(setup);
  client.loopback.jumpers[0].output = 0;
  client.write(request::queue, 0, 0, queue_of({0, 1}));
  client.write(request::input_start, 0, 0,
               input_order({.scans = 0, .period = 0, .packet_size = 1, .options = input_option::burst}));
  client.port.submit_out(1, output_endpoint, samples_of(ramp(50)));
  client.write(request::output_start, 0, 0, output_order(50, 0, 6399, 1));
  const auto samples = client.collect(0.02, 64, 512);
  ASSERT_EQ(samples.size(), 2U * 50);
  for (std::size_t i = 1; i < 50; ++i) EXPECT_EQ(samples[2 * i], 32768 + i - 1);
}

// The timer clocks both and ends both by its count (protocol note 9, way 3).
TEST(OutputScan, SharesTheTimerAsItsClock) {
  UnitSetup setup = Client::perfect();
  setup.wiring.input_clock = setup.wiring.output_clock = ClockSource::timer;
  Client client(setup);
  client.write(request::queue, 0, 0, queue_of({0}));
  client.port.submit_out(1, output_endpoint, samples_of(ramp(100)));
  client.write(request::input_start, 0, 0,
               input_order({.period = 0, .packet_size = 0, .options = input_option::burst}));
  client.write(request::output_start, 0, 0, output_order(0, 0, 0, 1));
  Bytes parameters;
  for (const unsigned v : {6399U, 99U, 40U, 0U}) append32(parameters, v);
  client.write(request::timer_parameters, 0, 0, parameters);
  client.write(request::timer_control, 1);
  EXPECT_EQ(client.collect(0.02, 64, 512).size(), 40U);
  EXPECT_EQ(code(client.loopback.output_voltage(0)), 32768 + 39);
}

TEST(OutputScan, BothPacersDivideOneOscillator) {
  Recorder board;
  Client client(Client::perfect(), &board);
  client.write(request::queue, 0, 0, queue_of({0}));
  client.unit.set_trigger_pin(false);
  client.write(request::trigger, 0, 0, bytes_of({3}));
  client.write(request::input_start, 0, 0, input_order({.period = 6399, .options = input_option::trigger}));
  client.write(request::output_start, 0, 0, output_order(0, 0, 25599, 1 | output_option::trigger));
  client.port.submit_out(1, output_endpoint, samples_of(ramp(1500)));
  client.unit.set_trigger_pin(true);
  const auto samples = client.collect(0.5, 8, 512);
  ASSERT_GT(samples.size(), 4800U);
  for (std::size_t i = 1; i < samples.size(); ++i) ASSERT_EQ(samples[i], 32768 + (i - 1) / 4) << i;
}

}  // namespace
}  // namespace ferrobench::emulator

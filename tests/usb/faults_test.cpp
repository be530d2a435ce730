// Each fault shows as real units show it, once, at its moment, and the unit is sound afterwards.
#include "unit/faults.h"

#include <gtest/gtest.h>

#include <set>

#include "client.h"

namespace ferrobench::emulator {
namespace {

using enum Outcome;

class FaultsTest : public testing::Test {
 protected:
  // Continuous, 100 kS/s, transfers of one packet.
  void start(Client& client) {
    client.write(request::input_stop);
    client.write(request::input_clear);
    client.clear_halt(input_endpoint);
    EXPECT_EQ(client.write(request::queue, 0, 0, queue_of({0, 1})), ok);
    EXPECT_EQ(client.write(request::input_start, 0, 0, input_order({.period = 1279})), ok);
  }
  std::vector<std::uint16_t> take(Client& client) { return client.collect(0.05, 16, 512); }
  static bool follows(std::span<const std::uint16_t> samples, std::uint64_t first) {
    for (std::size_t i = 0; i < samples.size(); ++i)
      if (samples[i] != PatternBoard::code(first + i)) return false;
    return true;
  }
  void expect_sound(Client& client) {
    start(client);
    const auto first = board.conversions();
    const auto samples = take(client);
    EXPECT_GT(samples.size(), 4000U);
    EXPECT_TRUE(follows(samples, first));
  }

  PatternBoard board;
};

TEST_F(FaultsTest, Overrun) {
  Client client(Client::perfect(), &board);
  client.unit.arm({.overrun = 1000});
  start(client);
  const auto samples = take(client);
  EXPECT_EQ(samples.size(), 2000U / 256 * 256) << "whole packets of what was converted";
  EXPECT_TRUE(follows(samples, 0));
  EXPECT_NE(client.status() & status_bit::overrun, 0);
  client.port.cancel_all();
  client.collect(0);
  Client again(Client::perfect(), &board);
  expect_sound(again);
}

TEST_F(FaultsTest, Underrun) {
  Client client(Client::perfect(), &board);
  client.unit.arm({.underrun = 20});
  client.port.submit_out(1, output_endpoint, Bytes(2000));
  client.write(request::output_start, 0, 0, output_order(1000, 0, 6399, 1));
  client.pass(0.01);
  EXPECT_EQ(client.status() & (status_bit::underrun | status_bit::output_running | status_bit::output_done),
            status_bit::underrun);
}

TEST_F(FaultsTest, UnplugInMidScan) {
  Client client(Client::perfect(), &board);
  client.write(request::output_value, 0xC000, 0);
  client.pass(1e-3);
  EXPECT_GT(board.output_voltage(), 4);
  client.unit.arm({.unplug = 1000});
  start(client);
  const auto samples = client.collect(0.03, 16, 512);
  EXPECT_TRUE(follows(samples, 0));
  EXPECT_LE(samples.size(), 2000U);
  EXPECT_EQ(client.outcomes.back(), gone);
  EXPECT_EQ(client.write(request::input_stop), gone);
  EXPECT_EQ(board.output_voltage(), 0) << "without power there is no output";
  client.unit.plug();
  EXPECT_EQ(client.status(), 0U) << "the FPGA is empty again";
}

TEST_F(FaultsTest, ALostBusLeavesTheOutputWhereItIs) {
  Client client(Client::perfect(), &board);
  client.write(request::output_value, 0xC000, 0);
  client.unit.arm({.bus_loss = 100});
  start(client);
  client.collect(0.03, 16, 512);
  EXPECT_EQ(client.write(request::output_value, 0x8000, 0), gone);
  EXPECT_GT(board.output_voltage(), 4);
  client.unit.plug();
  EXPECT_EQ(client.status() & status_bit::fpga_configured, status_bit::fpga_configured);
  EXPECT_EQ(client.write(request::output_value, 0x8000, 0), ok);
}

TEST_F(FaultsTest, ARequestStallsTheNthTime) {
  Client client;
  client.unit.arm({.stall = StalledRequest{request::latch, 3}});
  EXPECT_EQ(client.write(request::latch, 1), ok);
  EXPECT_TRUE(client.read(request::latch, 1)) << "reads count, too";
  EXPECT_EQ(client.write(request::latch, 2), stall);
  EXPECT_EQ(client.write(request::latch, 3), ok);
  EXPECT_EQ(client.word(request::latch), 3U);
}

TEST_F(FaultsTest, AnAnswerIsCut) {
  Client client;
  client.unit.arm({.cut_answer = CutAnswer{request::status, 2, 1}});
  EXPECT_EQ(client.read(request::status, 2)->size(), 2U);
  EXPECT_EQ(client.read(request::status, 2)->size(), 1U);
  EXPECT_EQ(client.read(request::status, 2)->size(), 2U);
}

TEST_F(FaultsTest, AContinuousScanIsRotatedByOneChannel) {
  Client client(Client::perfect());
  client.loopback.jumpers[0].level = 1;
  client.loopback.jumpers[1].level = 2;
  client.unit.arm({.rotated = true});
  start(client);
  auto samples = take(client);
  EXPECT_NEAR(samples.at(0), 32768 + 6554, 1) << "channel 1 comes first";
  EXPECT_NEAR(samples.at(1), 32768 + 3277, 1);
  client.port.cancel_all();
  client.collect(0);
  Client again(Client::perfect(), &board);
  expect_sound(again);
}

TEST_F(FaultsTest, ARateIsNotTheOneAskedFor) {
  Client client(Client::perfect(), &board);
  client.unit.arm({.rate_error = 0.02});
  start(client);
  take(client);
  const auto scans = [&] { return get32(*client.read(request::counter, 8)); };
  EXPECT_NEAR(scans(), 50e3 * 1.02 * 0.05, 2);
}

TEST_F(FaultsTest, APacketIsCutButNothingIsLost) {
  Client client(Client::perfect(), &board);
  client.unit.arm({.short_packet = 700});
  start(client);
  const auto samples = take(client);
  EXPECT_TRUE(follows(samples, 0));
  EXPECT_EQ(std::count(client.lengths.begin(), client.lengths.end(), 256), 1);
}

TEST_F(FaultsTest, ASampleIsLostOrComesTwice) {
  for (const bool lost : {true, false}) {
    PatternBoard pattern;
    Client client(Client::perfect(), &pattern);
    client.unit.arm(lost ? Faults{.lost_sample = 500} : Faults{.doubled_sample = 500});
    start(client);
    const auto samples = take(client);
    EXPECT_TRUE(follows(std::span(samples).first(1000), 0));
    EXPECT_TRUE(follows(std::span(samples).subspan(1001), lost ? 1002 : 1000));
    EXPECT_EQ(samples.at(1000), PatternBoard::code(lost ? 1001 : 1000));
  }
}

TEST_F(FaultsTest, AHangGivesNothingUntilStopped) {
  Client client(Client::perfect(), &board);
  client.unit.arm({.hang = 512});
  start(client);
  const auto samples = take(client);
  EXPECT_GE(samples.size(), 512U);
  EXPECT_LE(samples.size(), 1024U) << "what had not left the FIFO stays there";
  EXPECT_EQ(client.write(request::input_stop), ok) << "requests still work";
  EXPECT_FALSE(client.unit.faults().hang);
}

TEST_F(FaultsTest, AHaltedEndpointStallsUntilCleared) {
  Client client(Client::perfect(), &board);
  client.unit.arm({.input_halt = 512, .output_halt = 3});
  start(client);
  take(client);
  EXPECT_NE(std::find(client.outcomes.begin(), client.outcomes.end(), stall), client.outcomes.end());
  EXPECT_TRUE(client.clear_halt(input_endpoint));
  client.port.submit_in(1000, input_endpoint, 512);
  client.pass(1e-3);
  client.port.submit_out(1001, output_endpoint, Bytes(32));
  client.write(request::output_start, 0, 0, output_order(0, 0, 6399, 1));
  client.pass(1e-3);
  client.port.take_finished();
  client.port.submit_out(1002, output_endpoint, Bytes(32));
  EXPECT_EQ(client.port.take_finished().at(0).outcome, stall);
  EXPECT_TRUE(client.clear_halt(output_endpoint));
  client.port.submit_out(1003, output_endpoint, Bytes(32));
  EXPECT_EQ(client.port.take_finished().at(0).outcome, ok);
}

TEST_F(FaultsTest, AnFpgaMayRefuseItsImageOnce) {
  Client client{UnitSetup{}};
  client.unit.arm({.fpga_refuses = true});
  client.load_fpga(73722);
  EXPECT_EQ(client.status(), 0U);
  client.load_fpga(73722);
  EXPECT_EQ(client.status(), status_bit::fpga_configured);
}

TEST_F(FaultsTest, DrawsAreSeededAndDiffer) {
  for (int kind = 0; kind < fault_kinds; ++kind) {
    const auto k = static_cast<FaultKind>(kind);
    EXPECT_FALSE(fault_name(k).empty());
    const auto a = draw_fault(k, 7, 1000), b = draw_fault(k, 7, 1000);
    EXPECT_EQ(a.overrun, b.overrun);
    EXPECT_EQ(a.unplug, b.unplug);
    EXPECT_EQ(a.rate_error, b.rate_error);
  }
  std::set<std::uint64_t> moments;
  for (std::uint64_t seed = 0; seed < 100; ++seed) {
    const auto drawn = draw_fault(FaultKind::overrun, seed, 1000);
    ASSERT_TRUE(drawn.overrun);
    EXPECT_LT(*drawn.overrun, 1000U);
    moments.insert(*drawn.overrun);
  }
  EXPECT_GT(moments.size(), 80U);
}

}  // namespace
}  // namespace ferrobench::emulator

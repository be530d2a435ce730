// A unit in a port of full speed: its packets are shorter and there are fewer of them.
#include <gtest/gtest.h>

#include "client.h"
#include "rig.h"
#include "tests/daq/programs.h"

namespace ferrobench::emulator {
namespace {

using enum Outcome;
using daq::line;

UnitSetup at_full_speed(UnitSetup setup) {
  setup.speed = Speed::full;
  return setup;
}

TEST(FullSpeed, TheEndpointsSayHowLongTheirPacketsAre) {
  for (const bool full : {false, true}) {
    const auto bytes = configuration_descriptor(full ? at_full_speed({}) : UnitSetup{});
    const std::size_t endpoints = 9 + 9;
    for (const std::size_t at : {endpoints, endpoints + 7})
      EXPECT_EQ(get16(std::span(bytes).subspan(at + 4)), full ? 64 : 512);
  }
}

TEST(FullSpeed, ALongerPacketThanTheEndpointHasIsBabble) {
  for (const unsigned samples : {32U, 33U, 256U}) {
    Client client(at_full_speed(Client::perfect()));
    client.write(request::queue, 0, 0, queue_of({0}));
    client.write(request::input_start, 0, 0, input_order({.period = 6399, .packet_size = samples - 1}));
    client.collect(0.1, 4, 512);
    ASSERT_FALSE(client.outcomes.empty());
    EXPECT_EQ(client.outcomes.front(), samples == 32 ? ok : babble) << samples;
  }
}

TEST(FullSpeed, ABusCarriesNineteenPacketsInAFrame) {
  // 1 MB/s in fit by themselves, with 0.3 MB/s out they do not.
  for (const bool both : {false, true}) {
    Client client(at_full_speed(Client::perfect()));
    client.write(request::queue, 0, 0, queue_of({0}));
    if (both) client.port.submit_out(1'000'000, output_endpoint, Bytes(150'000));
    client.write(request::input_start, 0, 0, input_order({.period = 127, .packet_size = 31}));
    if (both) client.write(request::output_start, 0, 0, output_order(0, 0, 426, 1));
    client.collect(0.3, 64, 512);
    const unsigned failed = client.status() & (status_bit::overrun | status_bit::underrun);
    EXPECT_EQ(failed != 0, both);
  }
}

TEST(FullSpeed, TheDriverTakesThePacketsThatThereAre) {
  for (const double rate : {50.0, 1000.0, 25000.0}) {
    ProofBoard board;
    Rig rig(proof_config(), board, at_full_speed(jumpered()));
    auto& device = rig.device();
    EXPECT_EQ(device.info().at("link_speed"), "full");
    daq::Guard guard(device, daq::Limits{});
    const auto program = daq::program({line(0, 1e6, 0.5), line(1e6, 0, 0.5)}, device.scan_rate(rate));
    const auto rows = program.size();
    guard.start(program);
    std::uint64_t came = 0;
    for (daq::SampleBlock block; guard.read(block);) came += block.rows;
    EXPECT_EQ(guard.outcome().end, daq::End::complete) << rate << ": " << guard.outcome().reason;
    EXPECT_EQ(came, rows);
  }
}

TEST(FullSpeed, TheDriverRefusesWhatTheBusDoesNotCarry) {
  ProofBoard board;
  auto config = proof_config();
  for (const char* channel : {"charge", "displacement", "force"}) config.erase(channel);
  Rig rig(config, board, at_full_speed(jumpered()));
  // Two inputs and an output of two bytes each; the converter itself does 250 kHz.
  const double most = 19 * 64 * 1000 / 6.0;
  EXPECT_NO_THROW(rig.device().scan_rate(0.99 * most));
  EXPECT_THROW(rig.device().scan_rate(1.01 * most), Error);
}

}  // namespace
}  // namespace ferrobench::emulator

// Control requests against the protocol note's table (section 2), EEPROM (7) and FPGA (8).
#include <gtest/gtest.h>

#include <bit>

#include "client.h"

namespace ferrobench::emulator {
namespace {

float float_at(const Bytes& bytes, std::size_t at) {
  return std::bit_cast<float>(get32(std::span(bytes).subspan(at)));
}

TEST(Requests, BeforeTheFpgaIsLoadedOnlyMemoryStatusLedResetSerialAndLoadingWork) {
  Client client{UnitSetup{}};
  EXPECT_EQ(client.status(), 0U);
  EXPECT_EQ(client.read(request::serial, 8),
            (Bytes{std::byte{'0'}, std::byte{'1'}, std::byte{'A'}, std::byte{'2'}, std::byte{'B'},
                   std::byte{'3'}, std::byte{'C'}, std::byte{'4'}}));
  EXPECT_TRUE(client.read(request::memory, 4));
  EXPECT_EQ(client.write(request::blink, 0, 0, bytes_of({3})), Outcome::ok);
  EXPECT_EQ(client.unit.blinks(), 3U);
  for (const unsigned number : {0x00, 0x01, 0x02, 0x10, 0x14, 0x18, 0x20, 0x28, 0x2D, 0x43, 0x45, 0x52})
    EXPECT_FALSE(client.read(number, 16)) << number;
  for (const unsigned number : {0x00, 0x02, 0x13, 0x15, 0x18, 0x1B, 0x1C, 0x20, 0x28})
    EXPECT_EQ(client.write(number), Outcome::stall) << number;
}

class FpgaImages : public testing::TestWithParam<std::pair<std::uint16_t, std::size_t>> {};

TEST_P(FpgaImages, ConfigureWithTheirLastByte) {
  const auto [product, image] = GetParam();
  UnitSetup setup;
  setup.product = product;
  Client client(setup);
  EXPECT_EQ(client.write(request::fpga_data, 0, 0, Bytes(64)), Outcome::stall)
      << "outside configuration mode";
  EXPECT_EQ(client.write(request::fpga_configure, 0, 0, bytes_of({0xAA})), Outcome::stall);
  client.load_fpga(image - 1);
  EXPECT_EQ(client.status(), status_bit::fpga_configuring);
  EXPECT_EQ(client.write(request::fpga_data, 0, 0, Bytes(1)), Outcome::ok);
  EXPECT_EQ(client.status(), status_bit::fpga_configured);
  EXPECT_EQ(client.word(request::fpga_version), setup.fpga_version);
}

TEST(Requests, TheFirstConversionAfterTheFpgaWasLoadedIsGarbage) {
  constexpr std::size_t image = 73722;
  const auto conversion = [](Client& client) { return client.word(request::input_value, 0); };
  UnitSetup setup = Client::perfect();
  setup.fpga_loaded = false;
  Client client(setup);
  client.loopback.jumpers[0].level = 5;
  for (int time = 0; time < 2; ++time) {
    client.load_fpga(image);
    EXPECT_EQ(client.write(request::queue, 0, 0, queue_of({0})), Outcome::ok);
    EXPECT_GT(std::abs(static_cast<int>(conversion(client)) - 49152), 1000);
    for (int i = 0; i < 3; ++i) EXPECT_NEAR(conversion(client), 49152, 1);
  }
  // In a scan as well as by itself.
  client.load_fpga(image);
  client.write(request::queue, 0, 0, queue_of({0}));
  client.write(request::input_start, 0, 0, input_order({.scans = 3, .period = 6399}));
  const auto samples = client.collect(0.01);
  ASSERT_EQ(samples.size(), 3U);
  EXPECT_GT(std::abs(samples[0] - 49152), 1000);
  EXPECT_NEAR(samples[1], 49152, 1);
}

INSTANTIATE_TEST_SUITE_P(ProtocolNote8, FpgaImages,
                         testing::Values(std::pair{std::uint16_t{0x0112}, std::size_t{73829}},
                                         std::pair{std::uint16_t{0x0136}, std::size_t{73722}}));

TEST(Requests, TheFpgaKeepsItsImageOverAResetAndLosesItWithThePower) {
  Client client;
  EXPECT_EQ(client.write(request::reset), Outcome::ok);
  EXPECT_FALSE(client.unit.on_bus());
  Bytes answer;
  EXPECT_EQ(client.port.control({.type = vendor_in, .number = request::status, .length = 2}, {}, answer),
            Outcome::gone);
  client.unit.plug();
  EXPECT_EQ(client.status(), status_bit::fpga_configured);
  client.unit.unplug();
  client.unit.plug();
  EXPECT_EQ(client.status(), 0U);
}

TEST(Requests, UnknownNumbersAndWrongDataStall) {
  Client client;
  EXPECT_EQ(client.write(0x77), Outcome::stall);
  EXPECT_FALSE(client.read(0x77, 4));
  EXPECT_FALSE(client.read(request::input_start, 14)) << "can only be written";
  EXPECT_EQ(client.write(request::input_start, 0, 0, Bytes(13)), Outcome::stall);
  EXPECT_EQ(client.write(request::input_start, 0, 0, Bytes(16)), Outcome::stall);
  EXPECT_EQ(client.write(request::output_start, 0, 0, Bytes(14)), Outcome::stall);
  EXPECT_EQ(client.write(request::queue, 0, 0, Bytes(15)), Outcome::stall);
  EXPECT_EQ(client.write(request::output_value, 0x8000, 2), Outcome::stall) << "there are two outputs";
  EXPECT_EQ(client.write(request::calibration_source, 0, 0, bytes_of({11})), Outcome::stall);
  EXPECT_EQ(client.write(request::trigger, 0, 0, Bytes(2)), Outcome::stall);
}

TEST(Requests, ModelsWithoutOutputsStallTheirRequests) {
  for (const std::uint16_t product : {0x0110, 0x0111, 0x0134, 0x0135}) {
    UnitSetup setup = Client::loaded();
    setup.product = product;
    Client client(setup);
    EXPECT_EQ(client.write(request::output_value, 0x8000, 0), Outcome::stall);
    EXPECT_FALSE(client.read(request::output_value, 4));
    EXPECT_EQ(client.write(request::output_start, 0, 0, output_order(0, 0, 639, 1)), Outcome::stall);
  }
}

TEST(Requests, DigitalLinesAreLatchWhereDrivenAndTheBoardWhereNot) {
  Client client;
  client.loopback.lines = 0xA5;
  EXPECT_EQ(client.word(request::tristate), 0xFFU) << "all inputs after power-up";
  EXPECT_EQ(client.word(request::pins), 0xA5U);
  client.write(request::latch, 0x0F);
  EXPECT_EQ(client.word(request::pins), 0xA5U);
  client.write(request::tristate, 0xF0);
  EXPECT_EQ(client.word(request::pins), 0xAFU);
  EXPECT_EQ(client.word(request::latch), 0x0FU);
  EXPECT_EQ(client.loopback.driven(), 0x0F);
  EXPECT_EQ(client.loopback.levels(), 0x0F);
  EXPECT_EQ(client.read(request::pins, 1), bytes_of({0xAF}))
      << "one client asks for one byte, another for two";
}

TEST(Requests, CalibrationIsWhereTheNoteSaysAndReadsOn) {
  UnitSetup setup = Client::loaded();
  Client client(setup);
  client.write(request::memory_address, 0, 0, bytes_of({0x00, 0x70}));
  const auto input = client.read(request::memory, 32);
  ASSERT_TRUE(input);
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_EQ(float_at(*input, 8 * i), setup.calibration.input[i].slope);
    EXPECT_EQ(float_at(*input, 8 * i + 4), setup.calibration.input[i].offset);
  }
  EXPECT_EQ(client.word(request::memory_address), 0x7020U) << "the address moves along";
  client.write(request::memory_address, 0, 0, bytes_of({0x80, 0x70}));
  const auto output = client.read(request::memory, 16);
  ASSERT_TRUE(output);
  EXPECT_EQ(float_at(*output, 8), setup.calibration.output[1].slope);
  client.write(request::memory_address, 0, 0, bytes_of({0x98, 0x70}));
  EXPECT_EQ(client.read(request::memory, 2), bytes_of({0x07, 0xE5})) << "2021, big endian";
}

TEST(Requests, MemoryIsLockedButForTheUsers) {
  Client client;
  const auto at = [&](unsigned address) {
    client.write(request::memory_address, 0, 0, bytes_of({address & 0xFFU, address >> 8}));
  };
  at(0x7000);
  EXPECT_EQ(client.write(request::memory, 0, 0, bytes_of({1, 2})), Outcome::stall);
  at(0x7410);
  EXPECT_EQ(client.write(request::memory, 0, 0, bytes_of({1, 2, 3})), Outcome::ok);
  at(0x7411);
  EXPECT_EQ(client.read(request::memory, 2), bytes_of({2, 3}));
  at(0x7410 + 3048 - 1);
  EXPECT_EQ(client.write(request::memory, 0, 0, bytes_of({1, 2})), Outcome::stall) << "past the user's";
  at(0x8000);
  EXPECT_EQ(client.write(request::memory, 0, 0, bytes_of({0x55, 0xAA})), Outcome::ok);
  at(0x7000);
  EXPECT_EQ(client.write(request::memory, 0, 0, bytes_of({7})), Outcome::ok);
  at(0x8000);
  EXPECT_EQ(client.write(request::memory, 0, 0, bytes_of({0, 0})), Outcome::ok);
  at(0x7000);
  EXPECT_EQ(client.write(request::memory, 0, 0, bytes_of({8})), Outcome::stall) << "locked again";
  EXPECT_EQ(client.read(request::memory, 1), bytes_of({7}));
  at(0x7000);
  EXPECT_FALSE(client.read(request::memory, 65)) << "64 bytes per transfer";
  at(0x7FFF);
  EXPECT_FALSE(client.read(request::memory, 2)) << "past the end";
}

TEST(Requests, TemperatureIsInDegreesOver256) {
  UnitSetup setup = Client::loaded();
  setup.temperature = -2.5;
  Client client(setup);
  EXPECT_EQ(static_cast<std::int16_t>(client.word(request::temperature)), -640);
}

TEST(Requests, OneConversionUsesItsQueueElementsRange) {
  Client client(Client::perfect());
  client.loopback.jumpers[3].level = 0.5;
  Bytes queue(16);
  queue[0] = std::byte{3 | 3 << 3 | 1 << 5 | 0x80};  // +-1 V
  EXPECT_EQ(client.write(request::queue, 0, 0, queue), Outcome::ok);
  EXPECT_EQ(client.word(request::input_value, 3), 32768U + 16384U);
  EXPECT_FALSE(client.read(request::input_value, 2, 4)) << "not in the queue";
  queue[0] = std::byte{3 | 1 << 5 | 0x80};  // +-10 V
  client.write(request::queue, 0, 0, queue);
  EXPECT_EQ(client.word(request::input_value, 3), 32768U + 1638U);
}

TEST(Requests, ConvertersHaveTheErrorsThatTheEepromStates) {
  UnitSetup setup = Client::loaded();
  Client client(setup);
  for (unsigned range = 0; range < 4; ++range) {
    const double volts = 0.73 * input_full_scale.at(range);
    client.loopback.jumpers[8].level = volts;
    Bytes queue(16);
    queue[0] = static_cast<std::byte>(0U | range << 3 | 2U << 5 | 0x80U);  // single-ended 8
    client.write(request::queue, 0, 0, queue);
    const double raw = client.word(request::input_value, 8);
    const auto& line = setup.calibration.input.at(range);
    const double lsb = input_full_scale.at(range) / 32768;
    EXPECT_NEAR((raw * line.slope + line.offset - 32768) * lsb, volts, 0.51 * lsb * line.slope);
    EXPECT_GT(std::abs((raw - 32768) * lsb - volts), 5 * lsb) << "an uncorrected code is wrong";
  }
}

TEST(Requests, OutputsFollowTheirCalibrationAndReadBackAsWritten) {
  UnitSetup setup = Client::loaded();
  Client client(setup);
  for (unsigned channel = 0; channel < 2; ++channel) {
    const auto& line = setup.calibration.output.at(channel);
    const double volts = channel == 0 ? -7.25 : 3.125;
    const auto raw = static_cast<unsigned>(line.slope * (volts / 10 * 32768 + 32768) + line.offset + 0.5);
    EXPECT_EQ(client.write(request::output_value, raw, channel), Outcome::ok);
    client.pass(1e-5);
    EXPECT_NEAR(client.loopback.output_voltage(channel), volts, 10.0 / 32768);
    const auto back = client.read(request::output_value, 4);
    ASSERT_TRUE(back);
    EXPECT_EQ(get16(std::span(*back).subspan(2UL * channel)), raw);
  }
  client.write(request::reset);
  EXPECT_EQ(client.loopback.output_voltage(0), 0) << "outputs go to 0 V at reset";
}

TEST(Requests, CountersWrapAndClear) {
  UnitSetup setup = Client::loaded();
  setup.counters = {0xFFFFFFFE, 5};
  Client client(setup);
  client.unit.count_pulses(0, 3);
  client.unit.count_pulses(1, 1);
  auto counts = client.read(request::counter, 8);
  ASSERT_TRUE(counts);
  EXPECT_EQ(get32(*counts), 1U);
  EXPECT_EQ(get32(std::span(*counts).subspan(4)), 6U);
  EXPECT_EQ(client.write(request::counter, 1), Outcome::ok);
  counts = client.read(request::counter, 8);
  EXPECT_EQ(get32(std::span(*counts).subspan(4)), 0U);
  EXPECT_EQ(client.write(request::counter, 2), Outcome::stall);
}

TEST(Requests, TheTimerGivesSoManyPulses) {
  UnitSetup setup = Client::loaded();
  setup.wiring.counters[1] = ClockSource::timer;
  Client client(setup);
  Bytes parameters;
  for (const unsigned v : {63999U, 9U, 5U, 640U}) append32(parameters, v);  // 1 kHz, 5 pulses, after 10 us
  EXPECT_EQ(client.write(request::timer_parameters, 0, 0, parameters), Outcome::ok);
  EXPECT_EQ(client.read(request::timer_parameters, 16), parameters);
  EXPECT_EQ(client.write(request::timer_control, 1, 0), Outcome::ok);
  EXPECT_EQ(client.read(request::timer_control, 1), bytes_of({3})) << "enabled, running";
  const auto count = [&] {
    const auto counts = client.read(request::counter, 8);
    return counts ? get32(std::span(*counts).subspan(4)) : 0;
  };
  client.pass(2.5e-3);
  EXPECT_EQ(count(), 3U);
  client.pass(10e-3);
  EXPECT_EQ(count(), 5U);
  EXPECT_EQ(client.read(request::timer_control, 1), bytes_of({1})) << "not running any more";
}

TEST(Requests, EnumerationTellsWhatTheNoteSays) {
  Client client;
  Bytes answer;
  ASSERT_EQ(client.port.control({.type = 0x80, .number = 6, .value = 0x0100, .length = 18}, {}, answer),
            Outcome::ok);
  ASSERT_EQ(answer.size(), 18U);
  EXPECT_EQ(get16(std::span(answer).subspan(8)), 0x09DB);
  EXPECT_EQ(get16(std::span(answer).subspan(10)), 0x0136);
  const auto serial_index = std::to_integer<unsigned>(answer[16]);
  ASSERT_EQ(client.port.control({.type = 0x80, .number = 6, .value = 0x0200, .length = 255}, {}, answer),
            Outcome::ok);
  ASSERT_EQ(answer.size(), get16(std::span(answer).subspan(2)));
  EXPECT_EQ(answer[20], std::byte{0x86}) << "first endpoint";
  EXPECT_EQ(get16(std::span(answer).subspan(22)), 512);
  EXPECT_EQ(answer[27], std::byte{0x02});
  ASSERT_EQ(client.port.control({.type = 0x80,
                                 .number = 6,
                                 .value = static_cast<std::uint16_t>(0x0300 | serial_index),
                                 .length = 255},
                                {}, answer),
            Outcome::ok);
  ASSERT_EQ(answer.size(), 18U);
  EXPECT_EQ(answer[2], std::byte{'0'});
  EXPECT_EQ(answer[16], std::byte{'4'});
}

}  // namespace
}  // namespace ferrobench::emulator

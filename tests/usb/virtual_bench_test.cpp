// The virtual bench behind the unit's terminals against the model itself.
#include "boards/virtual_bench.h"

#include <gtest/gtest.h>

#include "client.h"

namespace ferrobench::emulator {
namespace {

using recordings::Channel;

BenchConfig quiet() {
  BenchConfig config;
  model::Model crystal;
  crystal.name = "single crystal";
  crystal.load.prestress = 4e6;
  crystal.load.spring_stiffness = 2.7e6;
  config.specimen.model = model::to_json(crystal);
  for (auto* c : {&config.specimen.field, &config.specimen.charge, &config.specimen.displacement,
                  &config.specimen.force})
    c->noise = 0;
  config.marker_noise = 0;
  return config;
}

// A triangle of the field through FIFO, converter, amplifier and sensors, as the model alone has it.
TEST(VirtualBench, GivesTheModelsAnswerInVolts) {
  VirtualBench bench(quiet());
  Client client(Client::perfect(), &bench);
  constexpr std::size_t rows = 1000;
  constexpr double rate = 1000, volts_per_row = 7.0 / 250;
  std::vector<std::uint16_t> out;
  double volts = 0;
  for (std::size_t i = 0; i < rows; ++i) {
    out.push_back(static_cast<std::uint16_t>(std::lround(32768 + volts * 3276.8)));
    volts += i < 250 || i >= 750 ? volts_per_row : -volts_per_row;
  }
  client.write(request::queue, 0, 0, queue_of({0, 1, 2, 3, 4}));
  client.write(request::trigger, 0, 0, bytes_of({3}));
  client.port.submit_out(1, output_endpoint, samples_of(out));
  client.write(request::output_start, 0, 0,
               output_order(rows, 0, period_of(rate), 1 | output_option::trigger));
  client.write(request::input_start, 0, 0,
               input_order({.scans = rows,
                            .period = period_of(rate),
                            .options = input_option::trigger | input_option::burst}));
  client.unit.set_trigger_pin(true);
  const auto samples = client.collect(1.1);
  ASSERT_EQ(samples.size(), 5 * rows);

  // Each step takes the amplifier's rise time; the row of step i was taken just before it.
  std::vector<double> time{0}, field{0};
  const auto level = [&](std::size_t i) {
    return (out[i] - 32768) / 3276.8 * 20 / bench.model().actuator.layer_thickness;
  };
  for (std::size_t i = 0; i < rows; ++i) {
    const double begin = static_cast<double>(i) / rate + 1e-6;
    time.push_back(begin);
    field.push_back(field.back());
    time.push_back(begin + 20e-6);
    field.push_back(level(i));
  }
  const auto expected = model::simulate(bench.model(), time, field);
  const std::array channels{&expected.field, &expected.charge, &expected.displacement, &expected.force};
  const std::array ids{Channel::field, Channel::charge, Channel::displacement, Channel::force};
  for (std::size_t c = 0; c < 4; ++c) {
    const double range = bench.sensors().at(static_cast<std::size_t>(ids.at(c))).range;
    const auto [low, high] = std::minmax_element(channels.at(c)->begin(), channels.at(c)->end());
    const double tolerance = 0.51 * range / 32768 + 1e-3 * (*high - *low);
    // Converted 2 us apart: the channels after the first see the amplifier on its way to the next step.
    const double skew = c == 0 ? 0 : 0.3 * volts_per_row * 20 / bench.model().actuator.layer_thickness;
    for (std::size_t i = 0; i < rows; ++i) {
      const double measured = (samples[5 * i + c] - 32768) * range / 32768;
      const double slope = (*high - *low) / (14.0 * 20 / bench.model().actuator.layer_thickness);
      ASSERT_NEAR(measured, channels.at(c)->at(1 + 2 * i), tolerance + 4 * skew * slope) << c << " " << i;
    }
  }
  for (std::size_t i = 0; i < rows; ++i) ASSERT_EQ(samples[5 * i + 4], 32768 + 24576) << "the marker";
}

TEST(VirtualBench, NoiseIsSeeded) {
  const auto take = [](std::int64_t seed) {
    BenchConfig config = quiet();
    config.specimen.field.noise.reset();
    config.specimen.seed = seed;
    VirtualBench bench(config);
    Client client(Client::perfect(), &bench);
    client.write(request::queue, 0, 0, queue_of({0}));
    client.write(request::input_start, 0, 0, input_order({.scans = 500, .period = 6399}));
    return client.collect(0.1);
  };
  const auto first = take(1);
  EXPECT_EQ(first.size(), 500U);
  EXPECT_EQ(first, take(1));
  EXPECT_NE(first, take(2));
}

TEST(VirtualBench, TheAmplifierNeedsItsEnableLineAndInterlock) {
  BenchConfig config = quiet();
  config.enable_line = 1;
  config.interlock_line = 2;
  VirtualBench bench(config);
  Client client(Client::perfect(), &bench);
  const auto volts = [&] {
    client.pass(1e-3);
    bench.input(client.unit.now(), {});
    return bench.amplifier_voltage();
  };
  client.write(request::output_value, 0x8000 + 16384, 0);
  EXPECT_EQ(volts(), 0) << "not enabled";
  client.write(request::latch, 2);
  EXPECT_EQ(volts(), 0) << "the line is not driven yet";
  client.write(request::tristate, 0xFD);
  EXPECT_NEAR(volts(), 100, 0.01);
  EXPECT_EQ(client.word(request::pins) & 4U, 4U);
  bench.set_interlock(client.unit.now(), false);
  EXPECT_EQ(volts(), 0);
  EXPECT_EQ(client.word(request::pins) & 4U, 0U);
  bench.set_interlock(client.unit.now(), true);
  EXPECT_NEAR(volts(), 100, 0.01);
  client.unit.unplug();
  EXPECT_EQ(volts(), 0);
}

TEST(VirtualBench, RefusesWhatItDoesNotKnow) {
  EXPECT_THROW(bench_config_from_json({{"amplifier_gian", 10}}), Error);
  EXPECT_THROW(bench_config_from_json({{"rise_time", 0}}), Error);
  EXPECT_THROW(VirtualBench(bench_config_from_json({{"specimen", {{"model", "no such"}}}})), Error);
  EXPECT_EQ(bench_config_from_json({{"amplifier_gain", 10}}).amplifier_gain, 10);
}

}  // namespace
}  // namespace ferrobench::emulator

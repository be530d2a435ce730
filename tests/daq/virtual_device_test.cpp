#include "daq/virtual/virtual_device.h"

#include <gtest/gtest.h>

#include <chrono>
#include <thread>

#include "daq/guard/guard.h"
#include "programs.h"

namespace ferrobench::daq {
namespace {

using recordings::Channel;

VirtualConfig fast(std::int64_t seed = 1) {
  VirtualConfig config;
  config.clock = Clock::fast;
  config.seed = seed;
  return config;
}

model::Model crystal() {
  model::Model m;
  m.name = "single crystal";
  m.load.prestress = 4e6;
  m.load.spring_stiffness = 2.7e6;
  return m;
}

protocols::SampledWaveform loop(double rate) {
  return program({line(1.5e6, -1e6, 0.5), line(-1e6, -1e6, 0.2), line(-1e6, 1.5e6, 0.5)}, rate);
}

struct Taken {
  std::vector<std::int16_t> counts;
  std::vector<double> command;
  std::vector<BlockStatus> statuses;
};

Taken take(Device& device, const protocols::SampledWaveform& p) {
  Guard guard(device, Limits{});
  guard.go_to(p.value(0), 1e6);
  guard.start(p);
  Taken out;
  for (SampleBlock block; guard.read(block);) {
    out.counts.insert(out.counts.end(), block.counts.begin(), block.counts.end());
    out.command.insert(out.command.end(), block.command.begin(), block.command.end());
    out.statuses.push_back(block.status);
  }
  EXPECT_EQ(guard.outcome().end, End::complete) << guard.outcome().reason;
  return out;
}

TEST(VirtualDevice, SameSeedSameBytes) {
  VirtualDevice a(crystal(), fast(3)), b(crystal(), fast(3)), c(crystal(), fast(4));
  const auto first = take(a, loop(2000));
  EXPECT_EQ(first.counts.size(), 4 * loop(2000).size());
  EXPECT_EQ(first.counts, take(b, loop(2000)).counts);
  EXPECT_NE(first.counts, take(c, loop(2000)).counts);
}

TEST(VirtualDevice, SameBytesInRealTimeWhichTakesItsTime) {
  auto config = fast(3);
  VirtualDevice quick(crystal(), config);
  config.clock = Clock::real;
  VirtualDevice slow(crystal(), config);
  const auto p = program({line(0, 1e5, 0.2), line(1e5, 0, 0.2)}, 1000);
  const auto begin = std::chrono::steady_clock::now();
  EXPECT_EQ(take(slow, p).counts, take(quick, p).counts);
  EXPECT_GE(std::chrono::steady_clock::now() - begin, std::chrono::milliseconds(400));
}

TEST(VirtualDevice, RowsNeverComeBeforeTheirTime) {
  auto config = fast();
  config.clock = Clock::real;
  VirtualDevice device(crystal(), config);
  Guard guard(device, Limits{});
  const auto begin = std::chrono::steady_clock::now();
  guard.start(program({line(0, 0, 0.5)}, 3000));
  for (SampleBlock block; guard.read(block) && block.rows > 0;) {
    const std::chrono::duration<double> passed = std::chrono::steady_clock::now() - begin;
    EXPECT_GE(passed.count() * 3000, static_cast<double>(block.first_sample + block.rows - 1));
    EXPECT_LE(block.rows, 300U) << "a stop must not wait for more than 0.1 s";
  }
}

// Without noise, each row is what the model says for the field asked for, to half a count.
TEST(VirtualDevice, CountsAreTheModelsAnswer) {
  auto config = fast();
  for (auto* c : {&config.field, &config.charge, &config.displacement, &config.force}) c->noise = 0;
  VirtualDevice device(crystal(), config);
  const auto p = loop(1000);
  const auto taken = take(device, p);

  std::vector<double> time{0, 1.5}, field{0, 1.5e6};
  for (std::uint64_t i = 1; i < p.size(); ++i) {
    time.push_back(1.5 + static_cast<double>(i) / p.rate());
    field.push_back(p.value(i));
  }
  const auto expected = model::simulate(crystal(), time, field);
  const auto columns = device.columns();
  ASSERT_EQ(columns.size(), 4U);
  const std::array channels{&expected.field, &expected.charge, &expected.displacement, &expected.force};
  for (std::size_t c = 0; c < 4; ++c) {
    const auto [low, high] = std::minmax_element(channels[c]->begin(), channels[c]->end());
    // The two step in time differently.
    const double tolerance = 0.51 * columns[c].gain + 1e-3 * (*high - *low);
    for (std::size_t i = 0; i < p.size(); ++i) {
      const double measured = columns[c].offset + columns[c].gain * taken.counts[4 * i + c];
      ASSERT_NEAR(measured, channels[c]->at(i + 1), tolerance)
          << recordings::channel_name(columns[c].channel) << i;
    }
  }
}

TEST(VirtualDevice, RangesAreWideEnoughOfThemselves) {
  VirtualDevice device(crystal(), fast());
  for (const auto status : take(device, loop(500)).statuses) EXPECT_EQ(status, BlockStatus::ok);
  auto under_tension = crystal();
  under_tension.load.prestress = -5e6;
  VirtualDevice pulled(under_tension, fast());
  for (const auto status : take(pulled, loop(500)).statuses) EXPECT_EQ(status, BlockStatus::ok);
}

TEST(VirtualDevice, SaysWhenAConverterClips) {
  auto config = fast();
  config.field.range = 1e6;
  VirtualDevice device(crystal(), config);
  const auto statuses = take(device, loop(500)).statuses;
  EXPECT_NE(std::find(statuses.begin(), statuses.end(), BlockStatus::clipped), statuses.end());
}

TEST(VirtualDevice, NoiseIsWhatItStates) {
  auto config = fast();
  config.force.noise = 3;
  VirtualDevice device(crystal(), config);
  constexpr std::size_t rows = 50001;
  const auto taken = take(device, program({line(0, 0, 50)}, 1000));
  ASSERT_EQ(taken.counts.size(), 4 * rows);
  const double gain = device.columns()[3].gain;
  double sum = 0, squares = 0;
  for (std::size_t i = 0; i < rows; ++i) {
    const double v = gain * taken.counts[4 * i + 3] - crystal().load.prestress * crystal().actuator.area;
    sum += v;
    squares += v * v;
  }
  EXPECT_EQ(device.noise()[static_cast<std::size_t>(Channel::force)], 3.0);
  EXPECT_NEAR(sum / rows, 0, 5 * 3 / std::sqrt(rows) + gain / 2);
  EXPECT_NEAR(std::sqrt(squares / rows), 3, 3 * 5 / std::sqrt(2.0 * rows) + gain);
}

TEST(VirtualDevice, ScansFromOneToHalfAMillionSamplesASecondOverAllColumns) {
  VirtualDevice four(crystal(), fast());
  EXPECT_EQ(four.scan_rate(0.25), 0.25);
  EXPECT_EQ(four.scan_rate(125e3), 125e3);
  EXPECT_THROW(four.scan_rate(0.24), Error);
  EXPECT_THROW(four.scan_rate(std::nan("")), Error);
  try {
    four.scan_rate(200e3);
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::invalid_params);
    EXPECT_EQ(error.problems().at(0).allowed, (nlohmann::json{{"from", 0.25}, {"to", 125e3}}));
  }
  auto config = fast();
  config.charge.enabled = config.displacement.enabled = config.force.enabled = false;
  VirtualDevice one(crystal(), config);
  EXPECT_EQ(one.columns().size(), 1U);
  EXPECT_EQ(take(one, program({line(0, 1e5, 0.01)}, 500e3)).counts.size(), 5001U);
  Guard guard(four, Limits{});
  EXPECT_THROW(guard.start(program({line(0, 0, 1)}, 200e3)), Error);
}

TEST(VirtualDevice, ASlowScanIsReadWithPatience) {
  auto config = fast();
  config.clock = Clock::real;
  VirtualDevice device(crystal(), config);
  Guard guard(device, Limits{});
  guard.start(program({line(0, 0, 1.5)}, 1 / 1.5));
  SampleBlock block;
  ASSERT_TRUE(guard.read(block));
  EXPECT_EQ(block.rows, 1U);
  ASSERT_TRUE(guard.read(block));
  EXPECT_EQ(block.rows, 0U);
  EXPECT_EQ(block.status, BlockStatus::timeout);
  ASSERT_TRUE(guard.read(block));
  EXPECT_EQ(block.rows, 1U);
  EXPECT_FALSE(guard.read(block));
  EXPECT_EQ(guard.outcome().end, End::complete);
}

TEST(VirtualDevice, APauseTakesRealTimeEvenOnAFastClock) {
  VirtualDevice device(crystal(), fast());
  Guard guard(device, Limits{});
  guard.start(program({line(0, 0, 1000), line(0, 1e5, 1)}, 100));
  guard.pause();
  SampleBlock block;
  std::size_t rows = 0;
  const auto begin = std::chrono::steady_clock::now();
  while (std::chrono::steady_clock::now() - begin < std::chrono::milliseconds(350) && guard.read(block))
    rows += block.rows;
  EXPECT_LE(rows, 100U);
  EXPECT_EQ(guard.progress().state, Progress::State::paused);
  guard.resume();
  while (guard.read(block)) rows += block.rows;
  EXPECT_GT(rows, 100'101U);
  EXPECT_EQ(guard.outcome().end, End::complete);
}

TEST(VirtualDevice, CanBeStoppedFromAnotherThread) {
  auto config = fast();
  config.clock = Clock::real;
  VirtualDevice device(crystal(), config);
  Guard guard(device, Limits{});
  guard.start(program({line(0, 1e5, 1), line(1e5, 1e5, 3600)}, 1000));
  std::thread other([&guard] {
    std::this_thread::sleep_for(std::chrono::milliseconds(250));
    guard.stop("enough");
  });
  std::size_t rows = 0;
  for (SampleBlock block; guard.read(block);) rows += block.rows;
  other.join();
  EXPECT_EQ(guard.outcome().end, End::stopped);
  EXPECT_TRUE(guard.outcome().output_at_zero);
  EXPECT_EQ(device.output(), 0);
  EXPECT_LT(rows, 100'000U);
}

// The mean of a column's counts in its first row and the nine after it.
double first_charge(VirtualDevice& device) {
  const auto taken = take(device, program({line(0, 0, 0.02)}, 1000));
  double sum = 0;
  for (std::size_t row = 0; row < 10; ++row) sum += taken.counts[4 * row + 1];
  return sum / 10 * device.columns()[1].gain;
}

TEST(VirtualDevice, BeginsAfterThePastOfItsConfiguration) {
  auto config = fast();
  VirtualDevice plus(crystal(), config);
  config.past = {protocols::PastKind::poled_minus};
  VirtualDevice minus(crystal(), config);
  config.past = {protocols::PastKind::visited, {}, {{-2e6, 1}, {0, 1}}};
  VirtualDevice visited(crystal(), config);
  EXPECT_EQ(visited.past(), config.past);
  const double charge = first_charge(plus);
  EXPECT_GT(charge, 0);
  EXPECT_NEAR(first_charge(minus), -charge, 0.01 * charge);
  EXPECT_NEAR(first_charge(visited), -charge, 0.2 * charge);
}

TEST(VirtualDevice, RefusesAPastThatItCannotPlay) {
  for (const auto* past : {R"({"kind": "cycled"})", R"({"kind": "visited"})", R"({"kind": "poled"})",
                           R"({"kind": "unpoled", "from": "unpoled"})"})
    EXPECT_THROW(virtual_config_from_json({{"past", nlohmann::json::parse(past)}}), Error) << past;
}

// What it says of itself, played by itself, ends where it is.
TEST(VirtualDevice, RemembersWhatItsOutputDid) {
  VirtualDevice device(crystal(), fast());
  EXPECT_EQ(device.past(), protocols::Past{protocols::PastKind::poled_plus});
  take(device, loop(2000));
  device.go_to(0, 1e6);
  const auto past = device.past();
  EXPECT_EQ(past.kind, protocols::PastKind::visited);
  // To the program's start, down, the hold, up again and back.
  ASSERT_EQ(past.levels.size(), 5U);
  EXPECT_NEAR(past.levels[1].field, -1e6, 1);
  EXPECT_NEAR(past.levels[1].seconds, 0.5, 1e-9);
  auto config = fast();
  config.past = past;
  VirtualDevice other(crystal(), config);
  EXPECT_NEAR(first_charge(other), first_charge(device), 1e-3 * std::abs(first_charge(device)));
}

TEST(VirtualDevice, TellsWhatItIs) {
  VirtualDevice device(crystal(), fast(9));
  const auto info = device.info();
  EXPECT_EQ(info.at("driver"), "virtual");
  EXPECT_EQ(info.at("seed"), 9);
  EXPECT_EQ(info.at("channels").size(), 4U);
  EXPECT_EQ(info.at("channels")[2].at("channel"), "displacement");
  EXPECT_EQ(device.model(), model::to_json(crystal()));
}

}  // namespace
}  // namespace ferrobench::daq

// The parts between bytes and levels: pace, tick cutter, output feed, inputs, watch.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <cmath>

#include "tests/daq/usb/bench.h"

namespace ferrobench::daq::usb {
namespace {

using testing::HasSubstr;

RC_GTEST_PROP(Pace, IsWhatItSaysAndAskingForItAgainGivesItAgain, ()) {
  const double fastest = *rc::gen::element(125e3, 100e3, 166666.7, 500e3);
  const double update = *rc::gen::element(0.0, 1000.0, 2000.0, 1999.3, 1e5, 5e5);
  const double asked =
      std::exp(*rc::gen::resize(rc::kNominalSize, rc::gen::inRange(0, 1000000)) * 1e-6 * std::log(fastest));
  const auto pace = pace_for(asked, update, fastest);
  const double rate = pace.row_rate();
  RC_ASSERT(pace.tick_rate() <= fastest * (1 + 1e-9));
  RC_ASSERT(pace_for(rate, update, fastest).row_rate() == rate);
  // Half a clock period per tick is what rounding may cost, twice where the number of ticks changed.
  const double coarse = 1.0 / static_cast<double>(pace.period);
  RC_ASSERT(std::abs(rate / asked - 1) <= 2 * coarse);
  if (2 * update <= fastest) RC_ASSERT(pace.tick_rate() >= std::min(update, fastest) * (1 - 2 * coarse));
}

TEST(Pace, KnownRates) {
  EXPECT_EQ(pace_for(125e3, 2000, 125e3).period, 512U);
  EXPECT_EQ(pace_for(125e3, 2000, 125e3).oversampling, 1U);
  const auto slow = pace_for(50, 2000, 125e3);
  EXPECT_EQ(slow.oversampling, 64U);
  EXPECT_EQ(slow.period, 20000U);
  EXPECT_EQ(slow.row_rate(), 50);
}

RC_GTEST_PROP(TickCutter, GivesTheSameTicksHoweverTheBytesAreCut, ()) {
  const auto width = *rc::gen::inRange<std::size_t>(1, 6);
  const auto bytes = *rc::gen::container<std::vector<std::uint8_t>>(rc::gen::arbitrary<std::uint8_t>());
  TickCutter cutter(width);
  std::vector<std::uint16_t> got;
  const auto data = std::as_bytes(std::span(bytes));
  for (std::size_t at = 0; at < data.size();) {
    const auto size = std::min(*rc::gen::inRange<std::size_t>(1, 9), data.size() - at);
    cutter.add(data.subspan(at, size));
    at += size;
    if (*rc::gen::arbitrary<bool>()) {
      const auto ticks = cutter.ticks();
      got.insert(got.end(), ticks.begin(), ticks.end());
      cutter.drop(ticks.size() / width);
    }
  }
  const auto rest = cutter.ticks();
  got.insert(got.end(), rest.begin(), rest.end());
  RC_ASSERT(got.size() == data.size() / (2 * width) * width);
  RC_ASSERT(cutter.received() * width == got.size());
  for (std::size_t i = 0; i < got.size(); ++i)
    RC_ASSERT(got[i] == static_cast<std::uint16_t>(bytes[2 * i] | bytes[2 * i + 1] << 8));
}

// Levels 0..60000 are their own codes here.
std::vector<std::uint16_t> codes_of(OutputFeed& feed, std::size_t count, std::size_t chunk) {
  std::vector<std::byte> bytes(2 * count);
  for (std::size_t at = 0; at < bytes.size(); at += 2 * chunk)
    feed.fill(std::span(bytes).subspan(at, std::min(2 * chunk, bytes.size() - at)));
  std::vector<std::uint16_t> out;
  for (std::size_t i = 0; i < count; ++i)
    out.push_back(load_le<std::uint16_t>(std::span(bytes).subspan(2 * i)));
  return out;
}

TEST(OutputFeed, TickKIsLevelKInEitherOrder) {
  const auto code = [](double level) { return static_cast<std::uint16_t>(std::lround(level)); };
  Pieces after({{.samples = 2, .level = 40}, {.samples = 1, .level = 100}});
  OutputFeed first(after, 0, 2, TickOrder::after_update, code);
  EXPECT_THAT(codes_of(first, 9, 4), testing::ElementsAre(0, 10, 20, 30, 40, 70, 100, 100, 100));
  EXPECT_TRUE(first.over());
  EXPECT_EQ(first.rows(), 4U);
  Pieces before({{.samples = 2, .level = 40}, {.samples = 1, .level = 100}});
  OutputFeed second(before, 0, 2, TickOrder::before_update, code);
  EXPECT_THAT(codes_of(second, 9, 1), testing::ElementsAre(10, 20, 30, 40, 70, 100, 100, 100, 100));
  EXPECT_EQ(second.levels().size(), 10U);
  EXPECT_EQ(second.levels()[0], 0);
  EXPECT_EQ(second.levels()[6], 100);
}

RC_GTEST_PROP(OutputFeed, NeverLeavesTheLineBetweenLevels, ()) {
  std::vector<LinearPiece> pieces;
  const auto count = *rc::gen::inRange(1, 8);
  for (int i = 0; i < count; ++i)
    pieces.push_back(
        {.samples = *rc::gen::inRange<std::uint64_t>(1, 50), .level = 1.0 * *rc::gen::inRange(0, 60000)});
  std::vector<double> expected{0};
  const auto n = *rc::gen::inRange<std::uint64_t>(1, 5);
  for (const auto& p : pieces) {
    const double from = expected.back();
    for (std::uint64_t i = 1; i <= p.samples * n; ++i)
      expected.push_back(from +
                         (p.level - from) * static_cast<double>(i) / static_cast<double>(p.samples * n));
  }
  Pieces source(pieces);
  OutputFeed feed(source, 0, n, TickOrder::before_update,
                  [](double level) { return static_cast<std::uint16_t>(std::lround(level)); });
  const auto chunk = *rc::gen::inRange<std::size_t>(1, 40);
  const auto codes = codes_of(feed, expected.size() + 10, chunk);
  for (std::size_t i = 0; i < codes.size(); ++i) {
    const double want = expected[std::min(i + 1, expected.size() - 1)];
    RC_ASSERT(std::abs(codes[i] - want) <= 0.500001);
  }
}

TEST(Inputs, ScalingIsCalibrationThenSensor) {
  auto json = bench_json();
  json["charge"] = {{"channel", 1}, {"range", 5}, {"capacitance", 2e-6}, {"offset", 0.5}};
  json["displacement"]["offset"] = -1;
  Calibration calibration;
  calibration.input.fill({1.02, 100});
  const Inputs inputs(usb_config_from_json(json), calibration);
  ASSERT_EQ(inputs.width(), 4U);
  const auto si = [&](std::size_t c, std::uint16_t code) {
    const auto& column = inputs.columns()[c];
    return column.column.offset + column.column.gain * column.count(code);
  };
  for (const std::uint16_t code : {0, 1000, 32768, 50000, 65535}) {
    EXPECT_NEAR(si(0, code), calibration.volts(InputRange::v10, code) * 20 / 1e-4, 1e-6);
    EXPECT_NEAR(si(1, code), (calibration.volts(InputRange::v5, code) - 0.5) * 2e-6, 1e-17);
    EXPECT_NEAR(si(2, code), (calibration.volts(InputRange::v10, code) + 1) / 2e5, 1e-16);
  }
}

TEST(Inputs, ATableBecomesEvenCountsWithinHalfACountAndClipsOutside) {
  auto json = bench_json();
  json["displacement"] = {{"channel", 2}, {"table", nlohmann::json::array()}};
  const auto curve = [](double v) { return -1e-6 * (v + 0.02 * v * v); };
  for (double v = -9; v <= 9; v += 0.5)
    json["displacement"]["table"].push_back({{"volts", v}, {"value", curve(v)}});
  const Calibration calibration;
  const Inputs inputs(usb_config_from_json(json), calibration);
  const auto& c = inputs.columns()[2];
  for (int code = 4000; code < 61000; code += 777) {
    const double v = calibration.volts(InputRange::v10, code);
    const double value = c.column.offset + c.column.gain * c.count(static_cast<std::uint16_t>(code));
    // Chords of the parabola are off by 0.02 (0.5)^2 / 4.
    EXPECT_NEAR(value, curve(v), 1e-6 * 0.02 * 0.25 / 4 + c.column.gain / 2 * 1.001) << code;
  }
  EXPECT_NEAR(calibration.volts(InputRange::v10, c.lowest_code), -9, 1e-3);
  EXPECT_NEAR(calibration.volts(InputRange::v10, c.highest_code), 9, 1e-3);
}

TEST(Watch, FindsTheFirstTickWhereAChannelIsNotWhereItBelongs) {
  const auto config = usb_config_from_json(bench_json());
  const Inputs inputs(config, Calibration{});
  const std::vector<double> rest(3, 0);
  const auto ticks = [](std::uint16_t a, std::uint16_t b) {
    return std::vector<std::uint16_t>{32768, 1, 32768, 49152, 32768, 2, 32768, a, 32768, 3, b, 49152};
  };
  EXPECT_EQ(Watch(inputs, config.monitor_check, 1000).check(0, ticks(49152, 32768), rest), "");
  EXPECT_THAT(Watch(inputs, config.monitor_check, 1000).check(10, ticks(2, 32768), rest),
              HasSubstr("tick 11"));
  const std::vector<std::uint16_t> rotated{49152, 32768, 1, 32768};
  EXPECT_THAT(Watch(inputs, {}, 1000).check(0, rotated, std::vector<double>{0}), HasSubstr("are rotated"));
}

TEST(Watch, TheMonitorMayBeLateButNotWrong) {
  auto json = bench_json();
  json.erase("marker");
  json["monitor_check"] = {{"tolerance", 1000}, {"delay", 0.003}};
  const auto config = usb_config_from_json(json);
  const Inputs inputs(config, Calibration{});
  const double slope = 3000;  // V/m per tick
  const auto run = [&](double late, double error) {
    Watch watch(inputs, config.monitor_check, 1000);
    for (std::uint64_t tick = 0; tick < 100; ++tick) {
      const double t = static_cast<double>(tick);
      const double measured = slope * std::max(0.0, t - late) + (tick == 60 ? error : 0);
      const auto code = static_cast<std::uint16_t>(std::lround(32768 + measured * 1e-4 / 20 / 10 * 32768));
      const std::vector<std::uint16_t> codes{code, 32768, 32768};
      const std::vector<double> level{slope * t};
      if (const auto wrong = watch.check(tick, codes, level); !wrong.empty()) return static_cast<int>(tick);
    }
    return -1;
  };
  EXPECT_EQ(run(0, 0), -1);
  EXPECT_EQ(run(3, 0), -1);
  EXPECT_EQ(run(0, 2000), 60);
  EXPECT_EQ(run(0, -30000), 60);
  EXPECT_GT(run(20, 0), 0);
}

}  // namespace
}  // namespace ferrobench::daq::usb

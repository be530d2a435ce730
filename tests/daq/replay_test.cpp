#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <filesystem>
#include <limits>

#include "daq/replay/play.h"
#include "daq/scaling.h"
#include "daq/virtual/virtual_device.h"
#include "programs.h"
#include "recordings/analysis/difference.h"
#include "recordings/file/reader.h"

namespace ferrobench::daq {
namespace {

using recordings::Channel;
using recordings::Recording;

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

ReplayConfig fast() {
  ReplayConfig config;
  config.clock = Clock::fast;
  return config;
}

// A run of the virtual device, as a recording. `during` is called after every block.
Recording measured(const protocols::SampledWaveform& program,
                   const std::function<void(Guard&, std::uint64_t rows)>& during = {}) {
  VirtualConfig config;
  config.clock = Clock::fast;
  model::Model crystal;
  crystal.load.prestress = 4e6;
  crystal.load.spring_stiffness = 2.7e6;
  VirtualDevice device(crystal, config);
  Recording r;
  r.header.title = "measured";
  r.header.specimen = {"crystal", 0.02, 2.5e-5, 1e-4, 100};
  r.header.device = device.info();
  r.header.device["sample_rate"] = program.rate();
  r.noise = device.noise();
  Scaling scaling(device.columns(), {}, program.rate());
  for (const auto channel : scaling.channels()) r.set(channel);
  r.raw = recordings::Raw{.columns = device.columns(), .counts = {}};
  Guard guard(device, Limits{});
  guard.go_to(program.value(0), 1e6);
  guard.start(program);
  for (SampleBlock block; guard.read(block);) {
    const auto rows = scaling.rows(block);
    r.time.insert(r.time.end(), rows.time.begin(), rows.time.end());
    for (const auto channel : scaling.channels()) {
      const auto values = rows.channels[static_cast<std::size_t>(channel)];
      auto& to = *r.channels[static_cast<std::size_t>(channel)];
      to.insert(to.end(), values.begin(), values.end());
    }
    r.raw->counts.insert(r.raw->counts.end(), rows.counts.begin(), rows.counts.end());
    r.events.insert(r.events.end(), block.events.begin(), block.events.end());
    if (during) during(guard, r.size());
  }
  const auto outcome = guard.outcome();
  r.status = outcome.end == End::complete ? "complete" : "aborted";
  r.reason = outcome.reason;
  r.segments = guard.segments();
  return r;
}

protocols::SampledWaveform loop(double rate) {
  return program({line(1.5e6, -1e6, 0.5), line(-1e6, -1e6, 0.2), sine(-1e6, 3e5, 7, 0.4, 0),
                  line(-1e6 + 3e5 * std::sin(2 * M_PI * 7 * 0.4), 1.5e6, 0.5)},
                 rate);
}

Replay again(const Recording& r, const ReplayConfig& config = fast()) {
  ReplayDevice device(r, config);
  return play(device, Limits{});
}

// Everything that was measured, to the bit.
void expect_identical(const Recording& a, const Recording& b) {
  const auto difference = recordings::compare(a, b);
  for (const auto& column : difference.columns)
    EXPECT_TRUE(column.identical()) << column.dataset << " at row " << (column.first ? column.first->row : 0);
  for (const auto& value : difference.tables)
    ADD_FAILURE() << value.place << ": " << value.a << " and " << value.b;
}

TEST(Replay, OfARunIsIdenticalToTheBit) {
  const auto r = measured(loop(3000));
  const auto replay = again(r);
  EXPECT_EQ(replay.outcome.end, End::complete) << replay.outcome.reason;
  EXPECT_TRUE(replay.outcome.output_at_zero);
  expect_identical(r, replay.recording);
  EXPECT_EQ(replay.recording.header.device["driver"], "replay");
  EXPECT_EQ(replay.recording.header.device["played"], "counts");
}

TEST(Replay, OfAPausedRunIsIdentical) {
  bool resumed = false;
  const auto r = measured(program({line(0, 1e6, 0.3), line(1e6, 1e6, 0.5), line(1e6, 0, 0.3)}, 1000),
                          [&](Guard& guard, std::uint64_t rows) {
                            if (rows > 200 && guard.progress().state == Progress::State::running && !resumed)
                              guard.pause();
                            if (guard.progress().state == Progress::State::paused && rows > 400) {
                              guard.resume();
                              resumed = true;
                            }
                          });
  ASSERT_TRUE(resumed);
  ASSERT_GE(r.events.size(), 2U);
  ASSERT_GT(r.size(), 1101U);
  expect_identical(r, again(r).recording);
}

TEST(Replay, OfAnAbortedRunIsIdentical) {
  const auto r =
      measured(program({line(0, 1e6, 1), line(1e6, 1e6, 9)}, 1000), [](Guard& guard, std::uint64_t rows) {
        if (rows > 500) guard.stop("enough");
      });
  ASSERT_EQ(r.status, "aborted");
  const auto replay = again(r);
  EXPECT_EQ(replay.outcome.end, End::complete) << replay.outcome.reason;
  expect_identical(r, replay.recording);
  EXPECT_EQ(replay.recording.segments.back().label, "safe stop");
}

TEST(Replay, ShippedRecordingsAreIdentical) {
  int found = 0;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(FERROBENCH_SOURCE)) {
    const auto path = entry.path().string();
    if (entry.path().extension() != ".h5" || path.find("/build") != std::string::npos) continue;
    SCOPED_TRACE(path);
    const auto r = recordings::read_recording(path);
    const auto replay = again(r);
    EXPECT_EQ(replay.outcome.end, End::complete) << replay.outcome.reason;
    expect_identical(r, replay.recording);
    ++found;
  }
  EXPECT_GE(found, 6);
}

TEST(Replay, SignalsWithoutCountsAndOnTheirOwnTimesAreIdentical) {
  auto r = measured(loop(1000));
  r.raw.reset();
  for (std::size_t i = 0; i < r.size(); ++i) r.time[i] = 0.1 + 1e-3 * std::pow(static_cast<double>(i), 1.01);
  for (auto& v : *r.channels[static_cast<std::size_t>(Channel::charge)]) v += 1e-20;
  r.events = {{r.time[10], "note", "here"}};
  const auto replay = again(r);
  expect_identical(r, replay.recording);
  EXPECT_EQ(replay.recording.header.device["played"], "signals");
  EXPECT_EQ(replay.recording.header.device["equally_spaced"], false);
}

TEST(Replay, GapsStayGaps) {
  auto r = measured(loop(1000));
  const auto lose = [&r](std::size_t first, std::size_t last) {
    for (auto& channel : r.channels)
      for (std::size_t i = first; i < last; ++i) channel->at(i) = nan;
    for (std::size_t i = 4 * first; i < 4 * last; ++i) r.raw->counts[i] = -32768;
  };
  lose(0, 3);
  lose(100, 250);
  lose(r.size() - 20, r.size());
  r.at(Channel::command);
  for (std::size_t i = 300; i < 310; ++i)
    r.channels[0]->at(i) = nan;  // measured, not known what was asked for
  r.events.push_back({0.1, "gap", "150 rows were lost"});
  expect_identical(r, again(r).recording);
}

TEST(Replay, StatusesAndEventsComeWhereTheyHappened) {
  auto r = measured(loop(1000));
  r.events = {{0, "note", "before"},         {0.25, "clipped", "charge is past the converter's range"},
              {0.25, "note", "at that row"}, {0.251, "clipped", "again"},
              {0.3, "overrun", "late"},      {0.2, "note", "told late"},
              {99, "note", "after the end"}};
  ReplayDevice device(r, fast());
  const auto& source = device.source();
  Guard guard(device, source.limits(Limits{}));
  guard.go_to(source.program().value(0), 1e6);
  guard.start(source.program());
  std::vector<std::pair<BlockStatus, std::uint64_t>> statuses;
  for (SampleBlock block; guard.read(block);)
    if (block.status != BlockStatus::ok) statuses.emplace_back(block.status, block.first_sample);
  ASSERT_EQ(statuses.size(), 2U);
  EXPECT_EQ(statuses[0], (std::pair<BlockStatus, std::uint64_t>{BlockStatus::clipped, 250}));
  EXPECT_EQ(statuses[1], (std::pair<BlockStatus, std::uint64_t>{BlockStatus::overrun, 300}));
  expect_identical(r, again(r).recording);
}

TEST(Replay, AWindowIsThatPart) {
  const auto r = measured(loop(1000));
  auto config = fast();
  config.from = 0.2;
  config.to = 0.6;
  const auto part = again(r, config).recording;
  ASSERT_EQ(part.size(), 401U);
  EXPECT_EQ(part.time.front(), 0);
  EXPECT_NEAR(part.time.back(), 0.4, 1e-12);
  for (const auto channel : recordings::all_channels)
    for (std::size_t i = 0; i < part.size(); ++i) ASSERT_EQ(part.at(channel)[i], r.at(channel)[200 + i]);
  ASSERT_EQ(part.segments.size(), 2U);
  EXPECT_EQ(part.segments[0].end_sample, r.segments[0].end_sample - 200);
  EXPECT_EQ(part.segments[1].end_sample, 401);
  config.from = 7;
  EXPECT_THROW(ReplayDevice(r, config), Error);
  config.from = 0.6;
  EXPECT_THROW(ReplayDevice(r, config), Error);
}

TEST(Replay, AnotherCalibrationScalesTheCounts) {
  const auto r = measured(loop(1000));
  auto config = fast();
  config.displacement = {.gain = 1.25, .offset = -2e-6};
  const auto replay = again(r, config).recording;
  EXPECT_EQ(replay.raw->counts, r.raw->counts);
  EXPECT_EQ(replay.at(Channel::force), r.at(Channel::force));
  const auto &before = r.at(Channel::displacement), &after = replay.at(Channel::displacement);
  for (std::size_t i = 0; i < r.size(); ++i) ASSERT_NEAR(after[i], 1.25 * before[i] - 2e-6, 1e-18);
  constexpr auto d = static_cast<std::size_t>(Channel::displacement);
  EXPECT_DOUBLE_EQ(*replay.noise[d], 1.25 * *r.noise[d]);
  EXPECT_TRUE(replay.header.device["recalibrated"].contains("displacement"));
}

TEST(Replay, LimitsOfTheBenchDoNotCutWhatWasRecorded) {
  auto r = measured(loop(1000));
  for (auto& v : *r.channels[0]) v *= 10;
  for (auto& column : r.raw->columns) {
    column.gain *= 100;
    for (std::size_t i = 0; i < r.size(); ++i) {
      const auto c = static_cast<std::size_t>(&column - r.raw->columns.data());
      r.channels[static_cast<std::size_t>(column.channel)]->at(i) =
          column.offset + column.gain * r.raw->counts[4 * i + c];
    }
  }
  const auto replay = again(r);
  EXPECT_EQ(replay.outcome.end, End::complete) << replay.outcome.reason;
  expect_identical(r, replay.recording);
}

TEST(Replay, StoppedItIsSafeAndInventsNothing) {
  const auto r = measured(program({line(0, 1e6, 1), line(1e6, 1e6, 9)}, 1000));
  ReplayDevice device(r, fast());
  const auto replay = play(device, Limits{}, [](double share) { return share < 0.2; });
  EXPECT_EQ(replay.outcome.end, End::stopped);
  EXPECT_TRUE(replay.outcome.output_at_zero);
  const auto& got = replay.recording;
  EXPECT_EQ(got.status, "aborted");
  EXPECT_EQ(got.at(Channel::command).back(), 0);
  EXPECT_EQ(got.segments.back().label, "safe stop");
  const auto left = static_cast<std::size_t>(got.segments.back().start_sample);
  EXPECT_EQ(got.at(Channel::charge)[left], r.at(Channel::charge)[left]);
  for (std::size_t i = left + 1; i < got.size(); ++i)
    ASSERT_TRUE(std::isnan(got.at(Channel::charge)[i])) << i;
  EXPECT_TRUE(std::ranges::any_of(got.events, [](const auto& e) { return e.kind == "short_data"; }));
}

TEST(Replay, TakesItsTimeOverTheSpeed) {
  const auto r = measured(program({line(0, 1e5, 1), line(1e5, 0, 1)}, 500));
  auto config = fast();
  config.clock = Clock::real;
  config.speed = 5;
  const auto begin = std::chrono::steady_clock::now();
  expect_identical(r, again(r, config).recording);
  EXPECT_GE(std::chrono::steady_clock::now() - begin, std::chrono::milliseconds(400));
}

TEST(Replay, CannotBePausedNorPlayAnotherProgram) {
  const auto r = measured(loop(1000));
  ReplayDevice device(r, fast());
  const auto& source = device.source();
  EXPECT_THROW(device.scan_rate(500), Error);
  Guard guard(device, source.limits(Limits{}));
  guard.go_to(source.program().value(0), 1e6);
  guard.start(source.program());
  EXPECT_THROW(guard.pause(), Error);
  while (true)
    if (SampleBlock block; !guard.read(block)) break;
  Guard other(device, Limits{});
  other.go_to(0, 1e6);
  other.start(program({line(0, 1e5, 0.1)}, 1000));
  std::size_t rows = 0;
  for (SampleBlock block; other.read(block); rows += block.rows)
    for (const double v : block.signals[static_cast<std::size_t>(Channel::charge)])
      ASSERT_TRUE(std::isnan(v));
  EXPECT_EQ(rows, 101U);
  EXPECT_EQ(other.outcome().end, End::complete);
}

TEST(Replay, WhatCannotBePlayedIsRefusedWithItsPlace) {
  const auto good = measured(loop(1000));
  const auto refused = [](Recording r) {
    try {
      ReplayDevice device(std::move(r), fast());
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::bad_recording);
      EXPECT_FALSE(error.problems().empty());
      return error.problems().empty() ? std::string() : error.problems()[0].path;
    }
    return std::string("nothing was thrown");
  };
  auto r = good;
  r.raw->columns[2].gain = 0;
  EXPECT_EQ(refused(r), "/entry/instrument/raw/ai@gain");
  r.raw->columns[2].gain = nan;
  EXPECT_EQ(refused(r), "/entry/instrument/raw/ai@gain");
  r.raw->columns[2].gain = 1e306;
  EXPECT_EQ(refused(r), "/entry/instrument/raw/ai@gain");
  r = good;
  r.channels[0]->at(50) = 2e9;
  EXPECT_EQ(refused(r), "/entry/data/command");
  r = good;
  for (auto& v : *r.channels[0]) v = nan;
  EXPECT_EQ(refused(r), "/entry/data/command");
  r = good;
  r.channels[0].reset();
  r.channels[1].reset();
  EXPECT_EQ(refused(r), "/entry/data");
  r = {};
  EXPECT_EQ(refused(r), "/entry/data/time");
  auto config = fast();
  EXPECT_THROW(replay_config_from_json({{"file", "a"}, {"charge", {{"gain", 0}}}}), Error);
  EXPECT_THROW(replay_config_from_json({{"file", "a"}, {"speed", 0.5}}), Error);
  EXPECT_THROW(replay_config_from_json(nlohmann::json::object()), Error);
  EXPECT_THROW(ReplayDevice::open({{"file", "/nowhere.h5"}}), Error);
}

}  // namespace
}  // namespace ferrobench::daq

#include "daq/guard/feed.h"

#include <gtest/gtest.h>

#include <limits>

#include "programs.h"

namespace ferrobench::daq {
namespace {

// Up in 10 samples, hold 20, down in 10.
protocols::SampledWaveform trapezoid() {
  return program({line(0, 1000, 1), line(1000, 1000, 2), line(1000, 0, 1)}, 10);
}

std::vector<double> commands(Feed& feed) {
  SampleBlock block;
  block.rows = feed.issued();
  feed.take_rows(block);
  return block.command;
}

std::vector<std::string> kinds(Feed& feed) {
  std::vector<recordings::Event> events;
  feed.take_events(events);
  std::vector<std::string> out;
  for (const auto& e : events) out.push_back(e.kind);
  return out;
}

TEST(Feed, CommandsAreTheProgramsSamples) {
  const auto p = program(
      {line(0, 1000, 1), sine(1000, 300, 0.7, 2), line(1000 + 300 * std::sin(2 * M_PI * 1.4), 0, 1)}, 50);
  Feed feed(p, {});
  while (feed.next(7).samples != 0) {
  }
  EXPECT_TRUE(feed.over());
  const auto got = commands(feed);
  ASSERT_EQ(got.size(), p.size());
  for (std::size_t i = 0; i < got.size(); ++i) EXPECT_NEAR(got[i], p.value(i), 1e-9) << i;
}

TEST(Feed, APauseMakesItsHoldLonger) {
  Feed feed(trapezoid(), {});
  feed.pause();  // in the ramp: waits for the hold
  EXPECT_TRUE(feed.pausing());
  EXPECT_EQ(feed.next(100).samples, 10U);
  const auto waiting = feed.next(25);
  EXPECT_TRUE(waiting.waiting);
  EXPECT_EQ(waiting.samples, 25U);
  EXPECT_EQ(waiting.level, 1000);
  EXPECT_TRUE(feed.paused());
  feed.resume();
  EXPECT_FALSE(feed.next(100).waiting);
  while (feed.next(100).samples != 0) {
  }
  EXPECT_EQ(feed.issued(), 41U + 25U);
  EXPECT_EQ(kinds(feed), (std::vector<std::string>{"pause", "resume"}));
  const auto table = feed.segments(feed.issued());
  ASSERT_EQ(table.size(), 3U);
  EXPECT_EQ(table[1].start_sample, 10);
  EXPECT_EQ(table[1].end_sample, 55);
  EXPECT_EQ(table[2].end_sample, 66);
}

TEST(Feed, RefusesToPauseWhereNoHoldIsLeft) {
  Feed feed(trapezoid(), {});
  while (feed.issued() < 32) feed.next(1);
  EXPECT_THROW(feed.pause(), Error);
}

TEST(Feed, AStopRampsToZeroFromWhereItIs) {
  Limits limits;
  limits.stop_slew = 450;  // 45 a sample
  Feed feed(trapezoid(), limits);
  feed.next(5);
  feed.stop(End::stopped, "enough");
  EXPECT_FALSE(feed.over());
  EXPECT_EQ(feed.next(4).level, 500 - 4 * 45);
  EXPECT_EQ(feed.expected(), 10U + 8U);
  const auto last = feed.next(100);
  EXPECT_EQ(last.samples, 8U);  // 7.1 rounded up
  EXPECT_EQ(last.level, 0);
  EXPECT_EQ(feed.next(100).samples, 0U);
  EXPECT_TRUE(feed.over());
  const auto table = feed.segments(feed.issued());
  ASSERT_EQ(table.size(), 2U);
  EXPECT_EQ(table[0].end_sample, 5);
  EXPECT_EQ(table[1].label, "safe stop");
  EXPECT_EQ(table[1].end_sample, 18);
}

TEST(Feed, ASecondStopGoesFaster) {
  Limits limits;
  limits.stop_slew = 450;  // 45 a sample
  Feed feed(trapezoid(), limits);
  feed.next(5);
  feed.hasten(1000);  // nothing is on its way
  EXPECT_FALSE(feed.stopping());
  feed.stop(End::stopped, "enough");
  feed.next(2);
  feed.hasten(100);  // never slower
  EXPECT_EQ(feed.next(1).level, 500 - 3 * 45);
  feed.hasten(1000);
  EXPECT_EQ(feed.expected(), 9U + 4U);
  EXPECT_EQ(feed.next(1).level, 500 - 3 * 45 - 100);
  EXPECT_EQ(feed.next(100).samples, 3U);
  EXPECT_TRUE(feed.over());
  const auto table = feed.segments(feed.issued());
  ASSERT_EQ(table.size(), 3U);
  EXPECT_EQ(table[1].label, "safe stop");
  EXPECT_EQ(table[2].label, "hastened stop");
  EXPECT_EQ(table[2].rate, 1000);
}

TEST(Feed, APauseAtReverseFieldEndsWhenTheSpecimenHasHadEnough) {
  Limits limits;
  limits.reverse_field_threshold = -100;
  limits.reverse_field_time = 5;
  Feed feed(program({line(0, -1000, 1), line(-1000, -1000, 1), line(-1000, 0, 1)}, 10), limits);
  feed.pause();
  for (int i = 0; i < 200 && !feed.stopping(); ++i) feed.next(1);
  EXPECT_EQ(feed.end(), End::limit);
  EXPECT_NEAR(static_cast<double>(feed.issued()), 1 + 5 * 10, 5);
}

TEST(Feed, LevelsByTheBlockAreThoseOneByOne) {
  Limits limits;
  limits.stop_slew = 450;
  const auto p = program({line(0, 1000, 1), sine(1000, 300, 0.7, 2), line(1000, 1000, 3)}, 50);
  Feed by_one(p, limits), by_block(p, limits);
  std::vector<double> levels;
  for (std::size_t block = 1; levels.size() < 140; ++block) {
    std::vector<double> some(block);
    EXPECT_EQ(by_block.next_levels(some), block);
    levels.insert(levels.end(), some.begin(), some.end());
  }
  for (const double level : levels) EXPECT_EQ(by_one.next(1).level, level);
  by_one.stop(End::stopped, "enough");
  by_block.stop(End::stopped, "enough");
  std::vector<double> rest(1000);
  rest.resize(by_block.next_levels(rest));
  EXPECT_LT(rest.size(), 1000U);
  for (const double level : rest) EXPECT_EQ(by_one.next(1).level, level);
  EXPECT_TRUE(by_one.over());
  EXPECT_EQ(rest.back(), 0);
  EXPECT_EQ(by_block.next_levels(rest), 0U);
  EXPECT_EQ(commands(by_block), commands(by_one));
}

// Up in 10 samples of which every 5th is recorded, a hold of 200 with ten rows a decade, down in 10.
protocols::SampledWaveform sparse() {
  auto up = line(0, 1000, 1), hold = line(1000, 1000, 20), down = line(1000, 0, 1);
  up.recorded.rate = 2;
  hold.recorded.per_decade = 10;
  return program({up, hold, down}, 10);
}

SampleBlock block_of(std::uint64_t first, std::size_t rows) {
  SampleBlock block;
  block.first_sample = first;
  block.rows = rows;
  block.counts.reserve(2 * rows);
  for (std::size_t i = 0; i < rows; ++i)
    for (const auto column : {0, 1})
      block.counts.push_back(static_cast<std::int16_t>(2 * (first + i) + column));
  return block;
}

TEST(Feed, LeavesTheRowsThatAreRecordedAtTheirTimes) {
  Feed feed(sparse(), {});
  while (feed.next(17).samples != 0) {
  }
  const auto whole = sparse();
  std::vector<double> time, command;
  std::vector<std::int16_t> counts;
  std::uint64_t rows = 0;
  for (std::uint64_t first = 0, count = 1; first < whole.size(); first += count, count = 1 + first % 13) {
    auto block = block_of(first, std::min(count, whole.size() - first));
    feed.take_rows(block);
    EXPECT_EQ(block.first_sample, rows);
    rows += block.rows;
    ASSERT_EQ(block.counts.size(), 2 * block.rows);
    time.insert(time.end(), block.time.begin(), block.time.end());
    command.insert(command.end(), block.command.begin(), block.command.end());
    counts.insert(counts.end(), block.counts.begin(), block.counts.end());
  }
  EXPECT_EQ(rows, whole.recorded_size());
  EXPECT_EQ(feed.recorded(), rows);
  ASSERT_EQ(time.size(), rows);
  for (std::size_t i = 0; i < rows; ++i) {
    const auto row = static_cast<std::uint64_t>(std::lround(time[i] * 10));
    EXPECT_EQ(time[i], static_cast<double>(row) / 10);
    EXPECT_EQ(command[i], whole.value(row)) << row;
    EXPECT_EQ(counts[2 * i], 2 * static_cast<int>(row));
    EXPECT_EQ(counts[2 * i + 1], 2 * static_cast<int>(row) + 1);
  }
  const auto table = feed.segments(rows);
  ASSERT_EQ(table.size(), 3U);
  EXPECT_EQ(table[1].start_sample, 2);  // rows 0, 5, 10
  for (const auto& row : table) {
    const auto corner = time[static_cast<std::size_t>(row.start_sample)];
    EXPECT_TRUE(corner == 0 || corner == 1 || corner == 21) << corner;
  }
}

TEST(Feed, CountsTheLostRowsThatWouldHaveBeenRecorded) {
  Feed feed(sparse(), {});
  while (feed.next(100).samples != 0) {
  }
  auto first = block_of(0, 3), last = block_of(12, 4);  // 5 and 10 are lost
  feed.take_rows(first);
  EXPECT_EQ(first.rows, 1U);
  feed.take_rows(last);
  EXPECT_EQ(last.first_sample, 3U + 1U);  // row 11 is lost, too
  EXPECT_EQ(last.time, (std::vector<double>{1.2, 1.3, 1.4, 1.5}));
}

TEST(Feed, RecordsEveryRowOfAStop) {
  Limits limits;
  limits.stop_slew = 450;
  for (const bool taken : {false, true}) {
    Feed feed(sparse(), limits);
    feed.next(7);  // of which 5 is recorded
    auto before = block_of(0, taken ? 8 : 2);
    feed.take_rows(before);
    feed.stop(End::stopped, "enough");
    while (feed.next(100).samples != 0) {
    }
    auto rest = block_of(before.rows > 1 ? 8 : 2, feed.issued() - (before.rows > 1 ? 8 : 2));
    feed.take_rows(rest);
    const auto table = feed.segments(feed.recorded());
    ASSERT_EQ(table.size(), 2U);
    EXPECT_EQ(table[1].label, "safe stop");
    // Rows 0, 5 and 7; where 7 was read before the stop, 0, 5 and 8.
    EXPECT_EQ(table[1].start_sample, 2);
    EXPECT_EQ(table[1].end_sample, static_cast<std::int64_t>(before.rows + rest.rows));
    EXPECT_EQ(rest.command.back(), 0);
    EXPECT_NEAR(rest.time.back() - rest.time[rest.time.size() - 2], 0.1, 1e-9);
  }
}

TEST(Feed, GoesOnWithItsRowsInAPause) {
  Feed feed(sparse(), {});
  feed.next(10);
  feed.next(50);
  feed.pause();
  for (int i = 0; i < 10; ++i) feed.next(100);
  feed.resume();
  while (feed.next(100).samples != 0) {
  }
  auto all = block_of(0, feed.issued());
  feed.take_rows(all);
  // 1200 samples of a hold, from 10 on a tenth of a decade apart at first and then every 10 s.
  double widest = 0;
  for (std::size_t i = 1; i < all.rows; ++i) widest = std::max(widest, all.time[i] - all.time[i - 1]);
  EXPECT_EQ(widest, 10);
  const auto table = feed.segments(all.rows);
  ASSERT_EQ(table.size(), 3U);
  EXPECT_NEAR(all.time[static_cast<std::size_t>(table[2].start_sample)], 21 + 100, 1e-9);
}

TEST(Limiter, HoldsWhateverIsAskedFor) {
  const double infinity = std::numeric_limits<double>::infinity();
  Limits limits;
  limits.slew = 1e6;
  Limiter limiter(limits, 10, 0);
  EXPECT_EQ(limiter.pass(infinity, 5), 5e5);
  EXPECT_TRUE(limiter.altered());
  EXPECT_EQ(limiter.pass(std::nan(""), 5), 5e5);
  EXPECT_TRUE(limiter.altered());
  EXPECT_EQ(limiter.pass(1e9, 1000), 1.6e6);
  EXPECT_EQ(limiter.pass(-infinity, 1000), -1.6e6);
  EXPECT_EQ(limiter.pass(-1.5e6, 10), -1.5e6);
  EXPECT_FALSE(limiter.altered());
}

}  // namespace
}  // namespace ferrobench::daq

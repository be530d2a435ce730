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
  std::vector<double> out;
  feed.take_commands(0, feed.issued(), out);
  return out;
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

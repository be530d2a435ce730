#include "daq/guard/guard.h"

#include <gtest/gtest.h>

#include "daq/guard/trips.h"
#include "faulty_device.h"
#include "programs.h"

namespace ferrobench::daq {
namespace {

protocols::SampledWaveform loop() {
  return program({line(0, 1e6, 1), line(1e6, 1e6, 1), line(1e6, -1e5, 1), line(-1e5, 3e5, 1)}, 1000);
}

struct Session {
  explicit Session(const Limits& given = {}) : limits(given), device(given) {}

  // Reads to the end; `each` is called with the guard before every read.
  template <class Each>
  Outcome go(Each each, Interlock interlock = {}) {
    Guard guard(device, limits, std::move(interlock));
    guard.go_to(0, limits.slew);
    guard.start(loop());
    for (SampleBlock block; each(guard), guard.read(block);) {
      EXPECT_EQ(block.counts.size(), block.rows * 2);
      EXPECT_EQ(block.command.size(), block.rows);
      rows += block.rows;
      for (const auto& event : block.events) events.push_back(event.kind);
    }
    segments = guard.segments();
    EXPECT_EQ(guard.progress().state, Progress::State::ended);
    EXPECT_EQ(guard.progress().rows_read, rows + lost);
    SampleBlock after;
    EXPECT_FALSE(guard.read(after));
    return guard.outcome();
  }
  Outcome go() {
    return go([](Guard&) {});
  }
  void expect_safe(const Outcome& outcome) const {
    EXPECT_TRUE(outcome.output_at_zero);
    EXPECT_EQ(device.output(), 0);
    EXPECT_EQ(device.watched.crime(), "");
  }

  Limits limits;
  FaultyDevice device;
  std::size_t rows = 0;
  std::size_t lost = 0;
  std::vector<std::string> events;
  std::vector<recordings::SegmentRow> segments;
};

using Kinds = std::vector<std::string>;

TEST(Guard, ACompleteRunHasEveryRowOfTheProgramAndEndsAtZero) {
  Session run;
  const auto outcome = run.go();
  EXPECT_EQ(outcome.end, End::complete);
  EXPECT_EQ(outcome.reason, "");
  EXPECT_EQ(run.rows, loop().size());
  EXPECT_EQ(run.events, Kinds{});
  ASSERT_EQ(run.segments.size(), 4U);
  EXPECT_EQ(run.segments[3].end_sample, 4001);
  EXPECT_LE(run.device.steepest_go_to, run.limits.stop_slew);
  run.expect_safe(outcome);
}

TEST(Guard, LeavesTheNextRunAlone) {
  FaultyDevice device{Limits{}};
  {
    Guard before(device, {});
    before.go_to(0, 1e6);
    before.start(loop());
    for (SampleBlock block; before.read(block);) {
    }
    EXPECT_TRUE(before.outcome().output_at_zero);
    device.go_to(2e5, 1e6);  // as the next guard does
  }
  EXPECT_EQ(device.output(), 2e5);
}

TEST(Guard, LeavesTheNextRunAloneAlsoWhereItNeverStarted) {
  FaultyDevice device{Limits{}};
  {
    Guard before(device, {});
    device.go_to(1e5, 1e6);
    before.stop("on the way to its first level");
    EXPECT_THROW(before.go_to(2e5, 1e6), Error);
    before.release();
    EXPECT_EQ(device.output(), 0);
    EXPECT_TRUE(before.outcome().output_at_zero);
    device.go_to(2e5, 1e6);  // as the next guard does
  }
  EXPECT_EQ(device.output(), 2e5);
}

TEST(Guard, AStopIsARampInTheRecording) {
  Session run;
  const auto outcome = run.go([&run](Guard& guard) {
    if (run.rows > 1500) guard.stop("operator");
  });
  EXPECT_EQ(outcome.end, End::stopped);
  EXPECT_EQ(outcome.reason, "operator");
  EXPECT_EQ(run.events, Kinds{"stop"});
  EXPECT_EQ(run.segments.back().label, "safe stop");
  EXPECT_NEAR(static_cast<double>(run.rows), 1500 + 1000, 130);
  run.expect_safe(outcome);
}

TEST(Guard, ASecondStopIsAsFastAsLimitsAllow) {
  Limits limits;
  limits.stop_slew = 2e5;  // V/m/s: 5 s from 1 kV/mm
  limits.slew = 1e7;
  const auto rows = [&limits](bool again) {
    Session run(limits);
    const auto outcome = run.go([&](Guard& guard) {
      if (run.rows > 1500) guard.stop("operator");
      if (run.rows > 1600 && again) guard.hasten();
    });
    EXPECT_EQ(outcome.reason, "operator");
    run.expect_safe(outcome);
    return run.rows;
  };
  EXPECT_GT(rows(false), 6000U);
  EXPECT_LT(rows(true), 2000U);
}

TEST(Guard, TheWayBackWithoutAStreamCanBeHastened) {
  Limits limits;
  limits.stop_slew = 2e5;
  FaultyDevice device{limits};
  Guard guard(device, limits);
  guard.go_to(1e6, 1e7);
  device.steepest_go_to = 0;
  guard.hasten();
  guard.release();
  EXPECT_EQ(device.output(), 0);
  EXPECT_EQ(device.steepest_go_to, limits.slew);
}

TEST(Guard, AStopBeforeTheStartIsNotForgotten) {
  Session run;
  Guard guard(run.device, run.limits);
  guard.stop("changed my mind");
  EXPECT_THROW(guard.go_to(1e6, 1e6), Error);
  EXPECT_THROW(guard.start(loop()), Error);
  EXPECT_EQ(run.device.output(), 0);
}

TEST(Guard, AMeasuredValuePastItsLimitTrips) {
  Session run;
  run.device.displacement = 11000;  // 110 um
  const auto outcome = run.go();
  EXPECT_EQ(outcome.end, End::limit);
  EXPECT_NE(outcome.reason.find("displacement"), std::string::npos) << outcome.reason;
  EXPECT_EQ(run.events, Kinds{"limit"});
  run.expect_safe(outcome);
}

// The sensor ends at 327.67 um.
TEST(Guard, ASensorAtItsEndTripsIfTheLimitLiesBeyond) {
  const auto end_of = [](double min, double max, int count) {
    Limits limits;
    limits.displacement_min = min;
    limits.displacement_max = max;
    Session run(limits);
    run.device.displacement = static_cast<std::int16_t>(count);
    const auto outcome = run.go();
    run.expect_safe(outcome);
    return outcome;
  };
  for (const int count : {-32768, 32767}) {
    const auto outcome = end_of(-1e-3, 1e-3, count);
    EXPECT_EQ(outcome.end, End::limit) << count;
    EXPECT_NE(outcome.reason.find("the end of its sensor's range"), std::string::npos) << outcome.reason;
    EXPECT_EQ(end_of(-32768e-8, 32767e-8, count).end, End::complete) << count;  // the ends are allowed
    EXPECT_EQ(end_of(-3e-4, 3e-4, count).end, End::limit) << count;
  }
  for (const int count : {-32766, 32766}) EXPECT_EQ(end_of(-1e-3, 1e-3, count).end, End::complete) << count;
}

// 0 to 65.535 um: the noise of a specimen at rest reaches the lower end.
TEST(Trips, AnEndWhereTheSpecimenRestsSaysNothing) {
  Limits limits;
  limits.displacement_min = -1e-4;
  limits.displacement_max = 1e-4;
  for (const double gain : {1e-9, -1e-9}) {
    const recordings::RawColumn column{recordings::Channel::displacement, gain, 32768e-9};
    const Trips trips(limits, std::span(&column, 1), true);
    const auto at = [&](int count) {
      SampleBlock block;
      block.counts = {static_cast<std::int16_t>(count)};
      return trips.violation(block);
    };
    const int rest = gain > 0 ? -32768 : 32767, far = gain > 0 ? 32767 : -32768;
    EXPECT_FALSE(at(rest)) << gain;
    EXPECT_FALSE(at(0)) << gain;
    EXPECT_TRUE(at(far)) << gain;
  }
}

TEST(Guard, WhatWasMeasuredBeforeDoesNotTripAtASensorsEnd) {
  struct Recorded : FaultyDevice {
    using FaultyDevice::FaultyDevice;
    bool measures() const override { return false; }
  };
  Limits limits;
  limits.displacement_max = 1e-3;
  Recorded device(limits);
  device.displacement = 32767;
  Guard guard(device, limits);
  guard.start(loop());
  for (SampleBlock block; guard.read(block);) {
  }
  EXPECT_EQ(guard.outcome().end, End::complete);
}

TEST(Guard, AnAmplifierThatRunsAwayTrips) {
  Session run;
  Guard guard(run.device, run.limits);
  run.device.monitor_gain = 10;  // the monitor now shows 20 times what is put out
  guard.start(loop());
  for (SampleBlock block; guard.read(block);) {
  }
  EXPECT_EQ(guard.outcome().end, End::limit);
  EXPECT_LT(guard.progress().rows_read, 2000U);
}

TEST(Guard, AnOpenInterlockForbidsTheStartAndStopsARun) {
  Session run;
  bool closed = true;
  const auto outcome = run.go([&](Guard&) { closed = run.rows < 1200; }, [&closed] { return closed; });
  EXPECT_EQ(outcome.end, End::interlock);
  EXPECT_EQ(run.events, Kinds{"interlock"});
  run.expect_safe(outcome);

  closed = false;
  Guard guard(run.device, run.limits, [&closed] { return closed; });
  EXPECT_THROW(guard.go_to(1e6, 1e6), Error);
  EXPECT_THROW(guard.start(loop()), Error);
}

TEST(Guard, PausesOnlyInAHold) {
  Session run;
  int reads = 0;
  const auto outcome = run.go([&](Guard& guard) {
    ++reads;
    if (reads == 20) {
      guard.pause();
      EXPECT_EQ(guard.progress().state, Progress::State::paused);
    }
    if (reads == 3) {
      guard.pause();
      EXPECT_EQ(guard.progress().state, Progress::State::pausing);
    }
    if (reads == 40) {
      EXPECT_EQ(guard.progress().state, Progress::State::paused);
      guard.resume();
      EXPECT_THROW(guard.resume(), Error);
    }
    if (guard.progress().rows_read > 3500) {
      EXPECT_THROW(guard.pause(), Error);
    }
  });
  EXPECT_EQ(outcome.end, End::complete);
  EXPECT_GT(run.rows, loop().size() + 20 * 64);
  EXPECT_EQ(run.events, (Kinds{"pause", "resume"}));
  EXPECT_EQ(static_cast<std::size_t>(run.segments.back().end_sample), run.rows);
  run.expect_safe(outcome);
}

TEST(Guard, SurvivesADeviceThatFails) {
  for (const auto fault : {Fault::throws, Fault::throws_oddly, Fault::hangs, Fault::torn, Fault::stray,
                           Fault::ends_early, Fault::lost, Fault::underrun}) {
    for (const int deaf : {0, 2}) {
      Session run;
      run.device.fault = fault;
      run.device.fault_at = 20;
      const auto outcome = run.go([&](Guard&) {
        if (run.rows > 1200) run.device.deaf = deaf;
      });
      EXPECT_EQ(outcome.end, End::fault) << static_cast<int>(fault);
      EXPECT_NE(outcome.reason, "");
      EXPECT_EQ(run.rows, 20U * 64U);
      EXPECT_EQ(run.events.back(), "fault");
      run.expect_safe(outcome);
    }
  }
}

TEST(Guard, GoesOnThroughLostRowsAndSaysSo) {
  Session run;
  run.device.fault = Fault::gap;
  run.device.fault_at = 20;
  run.lost = 1;
  const auto outcome = run.go();
  EXPECT_EQ(outcome.end, End::complete);
  EXPECT_EQ(run.rows, loop().size() - 1);
  EXPECT_EQ(run.events, (Kinds{"gap", "overrun"}));
  run.expect_safe(outcome);
}

TEST(Guard, SaysSoWhenTheOutputCannotBeBroughtToZero) {
  Session run;
  run.device.fault = Fault::throws;
  run.device.fault_at = 10;
  const auto outcome = run.go([&](Guard&) { run.device.deaf = 1000; });
  EXPECT_EQ(outcome.end, End::fault);
  EXPECT_FALSE(outcome.output_at_zero);
  EXPECT_NE(run.device.output(), 0);
}

TEST(Guard, LeavesZeroBehindWhenItsScopeIsLeft) {
  FaultyDevice device{Limits{}};
  try {
    Guard guard(device, Limits{});
    guard.start(loop());
    SampleBlock block;
    for (int i = 0; i < 20; ++i) guard.read(block);
    EXPECT_NE(device.output(), 0);
    throw std::runtime_error("the disk is full");
  } catch (const std::runtime_error&) {
  }
  EXPECT_EQ(device.output(), 0);
  EXPECT_LE(device.steepest_go_to, Limits{}.stop_slew);
  EXPECT_EQ(device.watched.crime(), "");
}

TEST(Guard, RefusesWhatWouldPassALimit) {
  FaultyDevice device{Limits{}};
  Guard guard(device, Limits{});
  try {
    guard.start(program({line(0, 3e6, 1)}, 100));
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::limit_exceeded);
    EXPECT_EQ(error.problems().at(0).path, "/segments/0/level");
  }
  EXPECT_THROW(guard.go_to(-1.7e6, 1e6), Error);
  EXPECT_THROW(guard.go_to(std::nan(""), 1e6), Error);
  EXPECT_THROW(guard.go_to(0, 0), Error);
  EXPECT_THROW(guard.start(program({line(1e5, 0, 1)}, 100)), Error) << "the output is not there yet";
  EXPECT_EQ(device.watched.samples(), 0U);

  Limits senseless;
  senseless.stop_slew = -1;
  EXPECT_THROW(Guard(device, senseless), Error);
}

// Plays as many rows at a time as it is given and hands on the last of them.
class LongDevice final : public Device {
 public:
  nlohmann::json info() const override { return {{"driver", "long"}, {"clock", "fast"}}; }
  std::vector<recordings::RawColumn> columns() const override {
    return {{.channel = recordings::Channel::field, .gain = 100}};
  }
  OutputRange output_range() const override { return {-2e6, 2e6}; }
  double scan_rate(double asked) const override { return asked; }
  double output() const override { return level_; }
  void go_to(double level, double /*slew*/) override { level_ = level; }
  void start(double /*rate*/, LevelSource& source) override { source_ = &source; }
  bool read(SampleBlock& block) override {
    block.clear();
    const auto piece = source_->next(1 << 20);
    if (piece.samples == 0) return false;
    level_ = piece.level;
    row_ += piece.samples;
    block.first_sample = row_;
    block.rows = 1;
    block.counts = {static_cast<std::int16_t>(std::lround(level_ / 100))};
    return true;
  }

 private:
  LevelSource* source_ = nullptr;
  double level_ = 0;
  std::uint64_t row_ = 0;
};

// 72 hours at 20,000 rows a second: row numbers pass 2^31 and 2^32.
TEST(Guard, CountsTheRowsOfThreeDays) {
  constexpr double rate = 20'000, hours_72 = 72 * 3600;
  constexpr std::uint64_t most = 1ULL << 32;
  LongDevice device;
  Guard guard(device, Limits{});
  guard.go_to(0, 1e6);
  guard.start(program({line(0, 1e6, 1), line(1e6, 1e6, hours_72), line(1e6, 0, 1)}, rate));
  EXPECT_EQ(guard.progress().rows_expected, 5'184'040'001U);
  std::uint64_t row = 0;
  double time = 0;
  for (SampleBlock block; guard.read(block);) {
    if (block.rows == 0) continue;
    ASSERT_GT(block.first_sample, row);
    ASSERT_EQ(block.command.size(), 1U);
    ASSERT_EQ(block.command[0], block.counts[0] * 100.0) << block.first_sample;
    row = block.first_sample;
    if (!block.events.empty()) time = block.events.back().time;
    if (row > most) guard.stop("long enough");
  }
  EXPECT_EQ(guard.outcome().end, End::stopped);
  EXPECT_TRUE(guard.outcome().output_at_zero);
  ASSERT_GT(row, most + static_cast<std::uint64_t>(rate));
  EXPECT_EQ(guard.progress().rows_read, row + 1);
  EXPECT_NEAR(time, static_cast<double>(row) / rate, 1.1 * (1 << 20) / rate);
  const auto segments = guard.segments();
  ASSERT_EQ(segments.size(), 3U);
  EXPECT_EQ(segments[1].start_sample, 20'000);
  EXPECT_EQ(segments[2].label, "safe stop");
  EXPECT_GT(segments[2].start_sample, static_cast<std::int64_t>(most));
  EXPECT_EQ(segments[2].end_sample, static_cast<std::int64_t>(row) + 1);  // past its last
}

}  // namespace
}  // namespace ferrobench::daq

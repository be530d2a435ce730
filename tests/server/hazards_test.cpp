// Outputs that may not be at zero: everybody who asks is told to switch the amplifier off.
#include <gmock/gmock.h>

#include "recordings/file/reader.h"
#include "recordings/file/recover.h"
#include "recordings/file/writer.h"
#include "server/engine/aftermath.h"
#include "tests/daq/faulty_device.h"
#include "tests/server/engine_bench.h"

namespace ferrobench::server {
namespace {

using testing::AllOf;
using testing::HasSubstr;

const auto words = HasSubstr("the output may not be at zero, switch the amplifier off");

struct HazardTest : EngineTest {
  std::shared_ptr<daq::FaultyDevice> device = std::make_shared<daq::FaultyDevice>(daq::Limits{});
  std::string path = (folder.path / "run.h5").string();

  RunStatus play() {
    RunSetup setup;
    setup.id = "run";
    setup.plan = make_plan(request(trapezium(0.5, 1), true), engine.store());
    setup.device = std::make_shared<HeldDevice>(device);
    setup.path = path;
    server::Run run(std::move(setup), hub);
    run.begin();
    run.wait();
    return run.status();
  }
};

TEST_F(HazardTest, ARunSaysItInItsStatusAndInItsRecording) {
  device->fault = daq::Fault::lost;
  device->fault_at = 2;
  device->deaf = 1000;
  const auto status = play();
  EXPECT_EQ(status.state, RunState::aborted);
  EXPECT_FALSE(status.output_at_zero);
  EXPECT_THAT(status.warning, AllOf(words, HasSubstr("no answer")));
  EXPECT_NE(device->output(), 0);
  const auto events = recordings::read_recording(path).events;
  EXPECT_EQ(
      std::ranges::count_if(events, [](const auto& e) { return e.message.starts_with("the output may"); }),
      1);
}

TEST_F(HazardTest, ARunThatNeverBeganSaysItToo) {
  device->watched.put(1e5, 1);  // where somebody left it
  device->deaf = 1000;
  const auto status = play();
  EXPECT_EQ(status.state, RunState::aborted);
  EXPECT_FALSE(status.output_at_zero);
  EXPECT_THAT(status.warning, words);
}

TEST_F(HazardTest, ARunThatEndedAtZeroWarnsOfNothing) {
  EXPECT_EQ(play().warning, "");
}

// As after a crash: the journal of a run on a unit that is not attached.
TEST_F(HazardTest, WhatADeadProgramLeftIsSaidUntilTheUnitWasOpened) {
  {
    recordings::Header header;
    header.device = {
        {"driver", "usb"}, {"serial_number", "01ABCDEF"}, {"configuration", nlohmann::json::object()}};
    const std::array channels{recordings::Channel::command};
    const recordings::Writer writer(path, header, channels);
  }
  ASSERT_EQ(recordings::journal_state(path), recordings::JournalState::left);
  int warnings = 0;
  put_right(folder.path.string(), [&](bool failed, const std::string& text, const std::string& unit) {
    if (unit.empty()) return;
    EXPECT_TRUE(failed);
    EXPECT_EQ(unit, "01ABCDEF");
    EXPECT_THAT(text, words);
    EXPECT_EQ(text.find('\n'), std::string::npos) << text;
    engine.hazards().add(unit, text);
    ++warnings;
  });
  EXPECT_EQ(warnings, 1);

  EXPECT_EQ(engine.status().state, RunState::idle);
  EXPECT_FALSE(engine.status().output_at_zero);
  EXPECT_THAT(engine.status().warning, AllOf(words, HasSubstr("01ABCDEF")));
  finish(request(trapezium(0.2, 0.2), true));  // on another device
  EXPECT_FALSE(engine.status().output_at_zero);
  EXPECT_THAT(engine.status().warning, words);
  engine.hazards().resolve("01ABCDEF");
  EXPECT_TRUE(engine.status().output_at_zero);
  EXPECT_EQ(engine.status().warning, "");
}

// A device whose output stands at 0.1 kV/mm when it is closed.
struct ClosingTest : HazardTest {
  // What its output stands at when it goes.
  struct Closed final : daq::FaultyDevice {
    Closed(double& level) : FaultyDevice(daq::Limits{}), last(level) {}
    ~Closed() override { last = output(); }
    double& last;
  };
  int deaf = 0;
  double left_at = -1;
  daq::FaultyDevice* device = nullptr;
  Engine bench{folder.path / "closing", hub, [this](const std::string&, const nlohmann::json&) {
                 auto opened = std::make_unique<Closed>(left_at);
                 opened->watched.put(1e5, 1);
                 opened->deaf = deaf;
                 device = opened.get();
                 return opened;
               }};
};

TEST_F(ClosingTest, BringsTheOutputToZeroFirst) {
  const auto id = bench.open_device("faulty", nlohmann::json::object());
  EXPECT_NE(device->output(), 0);
  bench.close_device(id);
  EXPECT_EQ(left_at, 0);
  EXPECT_TRUE(bench.open_devices().empty());
  EXPECT_EQ(bench.status().warning, "");
}

TEST_F(ClosingTest, SaysThatTheDeviceDoesNotObey) {
  deaf = 1000;
  const auto id = bench.open_device("faulty", nlohmann::json::object());
  try {
    bench.close_device(id);
    ADD_FAILURE() << "nothing was said";
  } catch (const Error& failure) {
    EXPECT_EQ(failure.code(), ErrorCode::device_lost);
    EXPECT_THAT(failure.message(), AllOf(words, HasSubstr("no answer")));
  }
  EXPECT_TRUE(bench.open_devices().empty());
  EXPECT_FALSE(bench.status().output_at_zero);
  EXPECT_THAT(bench.status().warning, words);
}

}  // namespace
}  // namespace ferrobench::server

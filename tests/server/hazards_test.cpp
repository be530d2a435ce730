// Outputs that may not be at zero: everybody who asks is told to switch the amplifier off.
#include <gmock/gmock.h>

#include "recordings/recover.h"
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
    setup.device = device;
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

}  // namespace
}  // namespace ferrobench::server

// Nothing that takes its time keeps those waiting who look or stop.
#include <condition_variable>
#include <csignal>
#include <future>

#include "engine_bench.h"

namespace ferrobench::server {
namespace {

using namespace std::chrono_literals;

// Shut until it is opened; says when somebody waits before it.
class Door {
 public:
  void pass() {
    std::unique_lock lock(mutex_);
    ++waiting_;
    changed_.notify_all();
    changed_.wait(lock, [this] { return open_; });
  }
  void await_visitor() {
    std::unique_lock lock(mutex_);
    ASSERT_TRUE(changed_.wait_for(lock, 10s, [this] { return waiting_ > 0; }));
  }
  void open() {
    const std::scoped_lock lock(mutex_);
    open_ = true;
    changed_.notify_all();
  }

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  int waiting_ = 0;
  bool open_ = false;
};

class SlowOpening : public testing::Test {
 protected:
  ~SlowOpening() override { door.open(); }

  // Not later than the door opens: the answer to what must not wait for it.
  template <class F>
  static auto at_once(F&& act) {
    auto answer = std::async(std::launch::async, std::forward<F>(act));
    if (answer.wait_for(1s) != std::future_status::ready) ADD_FAILURE() << "kept waiting";
    return answer;
  }

  Folder folder;
  Hub hub;
  Door door;
  Engine engine{folder.path, hub, [this](const std::string& kind, const nlohmann::json& config) {
                  door.pass();
                  return daq::open_device(kind, config);
                }};
};

TEST_F(SlowOpening, ARunIsArmingMeanwhileAndTheBenchIsTaken) {
  auto asked = request(trapezium(0.05, 0.05), true);
  asked.idempotency_key = "once";
  auto started = std::async(std::launch::async, [&] { return engine.start(asked); });
  door.await_visitor();
  auto status = at_once([&] { return engine.status(); });
  const auto seen = status.get();
  EXPECT_EQ(seen.state, RunState::arming);
  EXPECT_EQ(seen.protocol, "trapezium");
  EXPECT_FALSE(seen.output_at_zero);
  EXPECT_EQ(engine.status(seen.run).run, seen.run);
  EXPECT_EQ(code_of([&] { engine.start(request(trapezium(0.1, 0.1), true)); }), ErrorCode::busy);
  EXPECT_EQ(code_of([&] { engine.set_limits({{"field_max", 1e6}}); }), ErrorCode::busy);
  EXPECT_EQ(code_of([&] { engine.pause(""); }), ErrorCode::bad_state);

  auto again = std::async(std::launch::async, [&] { return engine.start(asked); });
  door.open();
  EXPECT_EQ(started.get().run, seen.run);
  EXPECT_EQ(again.get().run, seen.run);
  EXPECT_EQ(engine.wait(seen.run).state, RunState::complete);
  EXPECT_EQ(engine.runs().size(), 1u);
}

TEST_F(SlowOpening, AStopMeanwhileKeepsTheRunFromMoving) {
  auto asked = request(trapezium(0.05, 30), false);
  asked.idempotency_key = "once";
  auto started = std::async(std::launch::async, [&] { return engine.start(asked); });
  door.await_visitor();
  at_once([&] { engine.abort("", "enough"); }).get();
  EXPECT_EQ(engine.status().reason, "enough");
  door.open();
  const auto run = engine.wait(started.get().run);
  EXPECT_EQ(run.state, RunState::aborted);
  EXPECT_NE(run.reason.find("enough"), std::string::npos) << run.reason;
  EXPECT_TRUE(run.output_at_zero);
  EXPECT_EQ(run.rows, 0);
  // Who asks again because no answer came does not start what was stopped.
  EXPECT_EQ(engine.start(asked).run, run.run);
}

TEST_F(SlowOpening, WhatCannotBeOpenedLeavesTheBenchFree) {
  auto asked = request(trapezium(0.05, 0.05), true);
  asked.set = {{"device.no_such", 1}};
  auto started = std::async(std::launch::async, [&] { return engine.start(asked); });
  door.await_visitor();
  const auto id = engine.status().run;
  door.open();
  EXPECT_EQ(code_of([&] { started.get(); }), ErrorCode::invalid_params);
  EXPECT_EQ(engine.status().state, RunState::idle);
  EXPECT_EQ(code_of([&] { engine.status(id); }), ErrorCode::not_found);
  EXPECT_EQ(engine.wait(engine.start(request(trapezium(0.05, 0.05), true)).run).state, RunState::complete);
}

TEST_F(SlowOpening, ShuttingDownWaitsForItAndStopsIt) {
  auto started =
      std::async(std::launch::async, [&] { return engine.start(request(trapezium(0.05, 30), false)); });
  door.await_visitor();
  auto stopped = std::async(std::launch::async, [&] { engine.stop(); });
  std::this_thread::sleep_for(50ms);
  door.open();
  stopped.get();
  started.get();
  EXPECT_EQ(engine.status().state, RunState::aborted);
  EXPECT_EQ(engine.status().rows, 0);
}

TEST_F(EngineTest, ADeviceThatTakesItsTimeKeepsNobodyFromStopping) {
  const auto id = engine.open_device("virtual", {{"clock", "fast"}});
  Door door;
  auto used = std::async(std::launch::async,
                         [&] { engine.with_device(id, [&](const daq::DeviceFacts&) { door.pass(); }); });
  door.await_visitor();
  auto looked = std::async(std::launch::async, [&] { return engine.status(); });
  EXPECT_EQ(looked.wait_for(1s), std::future_status::ready);
  // A run on this device waits its turn, and can be stopped meanwhile.
  auto asked = request(trapezium(0.05, 0.05), false);
  asked.device = id;
  asked.model = nullptr;
  auto started = std::async(std::launch::async, [&] { return engine.start(asked); });
  EXPECT_EQ(await({RunState::arming}).device, id);
  EXPECT_EQ(code_of([&] { engine.close_device(id); }), ErrorCode::busy);
  engine.abort("", "enough");
  door.open();
  used.get();
  EXPECT_EQ(engine.wait(started.get().run).rows, 0);
  engine.close_device(id);
}

// A run that is watched only after its bench has died would else wait for it for ever.
TEST(BenchLink, WhoWatchesAfterTheBenchHasDiedHearsOfItAtOnce) {
  struct Watcher : RunWatcher {
    void status(const bench::RunState&) override {}
    void event(const bench::Noted&) override {}
    void closed(const bench::Closed&) override {}
    void lost(const std::string& why) override { told.push_back(why); }
    std::vector<std::string> told;
  };
  const auto link = BenchLink::to_process();
  Watcher before, after;
  link->watch(1, &before);
  kill(static_cast<pid_t>(link->ready().process), SIGKILL);
  link->after_loss();
  link->watch(2, &after);
  EXPECT_EQ(before.told, std::vector<std::string>{"the bench process has died"});
  EXPECT_EQ(after.told, before.told);
}

}  // namespace
}  // namespace ferrobench::server

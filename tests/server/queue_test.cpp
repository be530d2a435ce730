// Plans and their runs, what the queue keeps, and when it goes on. Crashes of the whole daemon are
// queue_deaths.py's.
#include "server/queue/queue.h"

#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <cstdio>
#include <fstream>
#include <future>
#include <mutex>
#include <numbers>
#include <set>

#include "engine_bench.h"
#include "recordings/file/reader.h"
#include "server/methods/methods.h"

namespace ferrobench::server {
namespace {

using nlohmann::json;

Plan plan_of(json document) {
  auto plan = parse<Plan>(document, ErrorCode::invalid_params, "the plan");
  demand_valid(plan);
  return plan;
}

json short_run(bool fast = true) {
  return {{"protocol", trapezium(0.1, 0.1)}, {"model", "soft-pzt"}, {"fast", fast}};
}

std::vector<json> all_values(const Plan& plan) {
  std::vector<json> out;
  for (const auto& step : steps_of(plan)) out.emplace_back(step.values);
  return out;
}

TEST(QueuePlan, ConfirmedSweepsAreOutermostAndRepeatsAreWithinThem) {
  const auto plan = plan_of({{"run", short_run()},
                             {"repeats", 2},
                             {"sweeps",
                              {{{"set", "top"}, {"values", {1, 2}}},
                               {{"set", "prestress_MPa"}, {"values", {4, 8}}, {"confirm", "set {} MPa"}}}}});
  EXPECT_EQ(json(all_values(plan)), json::parse("[[1,4],[2,4],[1,4],[2,4],[1,8],[2,8],[1,8],[2,8]]"));
  const auto steps = steps_of(plan);
  EXPECT_EQ(steps[0].repeat, 1);
  EXPECT_EQ(steps[2].repeat, 2);
  EXPECT_EQ(to_confirm(plan, steps[0], json::object()), "set 4 MPa");
  EXPECT_EQ(to_confirm(plan, steps[1], setup_of(plan, steps[0])), "");
  EXPECT_EQ(to_confirm(plan, steps[4], setup_of(plan, steps[0])), "set 8 MPa");
  const auto request = request_of(plan, steps[5]);
  EXPECT_EQ(request.set, json::parse(R"({"top": 2, "prestress_MPa": 8})"));
  EXPECT_EQ(request.seed, 6) << "repeats differ in their noise";
}

TEST(QueuePlan, RangesEndWhereTheySay) {
  const auto values = [](json sweep) {
    sweep["set"] = "top";
    return all_values(plan_of({{"run", short_run()}, {"sweeps", {sweep}}}));
  };
  const auto linear = values({{"from", 0.1}, {"to", 0.5}, {"count", 5}});
  ASSERT_EQ(linear.size(), 5u);
  EXPECT_NEAR(linear[1][0].get<double>(), 0.2, 1e-15);
  EXPECT_EQ(linear[4][0], 0.5);
  const auto logarithmic = values({{"from", 0.1}, {"to", 1000}, {"count", 5}, {"spacing", "logarithmic"}});
  EXPECT_NEAR(logarithmic[2][0].get<double>(), 10, 1e-12);
  EXPECT_EQ(logarithmic[4][0], 1000);
}

TEST(QueuePlan, ASeedShufflesWithinABlockAlone) {
  json document{{"run", short_run()},
                {"repeats", 3},
                {"shuffle", true},
                {"seed", 5},
                {"sweeps",
                 {{{"set", "prestress_MPa"}, {"values", {4, 8}}, {"confirm", "set {} MPa"}},
                  {{"set", "top"}, {"from", 1}, {"to", 5}, {"count", 5}}}}};
  const auto drawn = steps_of(plan_of(document));
  std::set<std::int64_t> numbers;
  bool in_order = true;
  for (std::size_t i = 0; i < drawn.size(); ++i) {
    EXPECT_EQ(drawn[i].values[0], i < 15 ? 4 : 8);
    numbers.insert(drawn[i].number);
    in_order = in_order && drawn[i].number == static_cast<std::int64_t>(i);
  }
  EXPECT_EQ(numbers.size(), 30u);
  EXPECT_FALSE(in_order);
  EXPECT_EQ(json(all_values(plan_of(document))), json(all_values(plan_of(document))));
  const auto one = json(all_values(plan_of(document)));
  document["seed"] = 6;
  EXPECT_NE(json(all_values(plan_of(document))), one);
}

TEST(QueuePlan, WhatIsWrongIsSaidWithItsPlace) {
  const std::vector<std::pair<const char*, const char*>> wrong{
      {R"({"sweeps": [{"set": "top", "values": []}]})", "/sweeps/0/values"},
      {R"({"sweeps": [{"set": "top"}]})", "/sweeps/0"},
      {R"({"sweeps": [{"set": "top", "values": [1], "from": 1}]})", "/sweeps/0"},
      {R"({"sweeps": [{"set": "top", "values": [{}]}]})", "/sweeps/0/values/0"},
      {R"({"sweeps": [{"set": "top", "from": 0, "to": 1, "spacing": "logarithmic"}]})", "/sweeps/0/from"},
      {R"({"sweeps": [{"set": "top", "values": [1]}, {"set": "top", "values": [2]}]})", "/sweeps/1/set"},
      {R"({"sweeps": [{"set": "top", "from": 0, "to": 1, "count": 10000}], "repeats": 2})", "/sweeps"},
      {R"({"sweeps": [{"set": "", "values": [1]}]})", "/sweeps/0/set"},
      {R"({"repeats": 0})", "/repeats"},
      {R"({"format": "something"})", "/format"},
      {R"({"version": 2})", "/version"},
      {R"({"resume": "never"})", "/resume"},
      {R"({"wait": {"channel": "force", "value": 1}})", "/wait/tolerance"},
      {R"({"wait": {"channel": "command", "value": 1, "tolerance": 1}})", "/wait/channel"},
      {R"({"wait": {"channel": "force", "value": 1, "tolerance": 1, "unit": "um"}})", "/wait/unit"},
      {R"({"wait": {"channel": "force", "value": 1, "tolerance": 1, "for_s": 9, "timeout_s": 8}})",
       "/wait/timeout_s"},
      {R"({"run": {"device": "replay:a"}, "wait": {"channel": "force", "value": 1, "tolerance": 1}})",
       "/wait"},
      {R"({"run": {"idempotency_key": "x"}})", "/run/idempotency_key"}};
  for (const auto& [text, place] : wrong) {
    auto document = json::parse(text);
    if (!document.contains("run")) document["run"] = short_run();
    try {
      plan_of(document);
      ADD_FAILURE() << text;
    } catch (const Error& error) {
      ASSERT_FALSE(error.problems().empty()) << text;
      EXPECT_EQ(error.problems().front().path, place) << text;
    }
  }
}

// Ten rows a stretch of 0.1 s. `force` gives that of each row, in N.
std::unique_ptr<Watch> watched(const Wait& wait, double seconds, const std::function<double(double)>& force,
                               double lost_from = 1e9, double lost = 0) {
  auto watch = std::make_unique<Watch>(wait);
  recordings::Columns columns;
  auto& values = columns.channels.at(static_cast<std::size_t>(recordings::Channel::force));
  for (int row = 0; row < static_cast<int>(std::lround(seconds * 100)); ++row) {
    const double time = 0.01 * row;
    if (time >= lost_from && time < lost_from + lost) continue;
    columns.time.push_back(time);
    values.push_back(force(time));
  }
  watch->see(columns.rows());
  return watch;
}

TEST(QueueWait, ItIsTheMeanThatStaysWithoutABreak) {
  using Verdict = Watch::Verdict;
  const Wait wait{
      .channel = Watched::force, .value = -0.1, .tolerance = 0.002, .unit = "kN", .lasting = 1, .timeout = 3};
  const auto hum = [](double t) { return -101 + 20 * std::sin(2 * std::numbers::pi * 50 * t + 1); };
  EXPECT_EQ(watched(wait, 0.95, hum)->verdict(), Verdict::none) << "not for 1 s yet";
  EXPECT_EQ(watched(wait, 1.05, hum)->verdict(), Verdict::met);
  const auto slips = [](double t) { return t > 0.7 && t < 0.9 ? -110.0 : -100.0; };
  EXPECT_EQ(watched(wait, 1.8, slips)->verdict(), Verdict::none);
  EXPECT_EQ(watched(wait, 2.1, slips)->verdict(), Verdict::met);
  const auto steady = [](double) { return -100.0; };
  EXPECT_EQ(watched(wait, 1.85, steady, 0.5, 0.3)->verdict(), Verdict::met);
  EXPECT_EQ(watched(wait, 1.75, steady, 0.5, 0.3)->verdict(), Verdict::none) << "rows were lost";
  const auto never = watched(wait, 3.5, [](double) { return -97.0; });
  EXPECT_EQ(never->verdict(), Verdict::failed);
  EXPECT_EQ(never->reason(), "waited 3 s for force within 0.002 kN of -0.1 kN for 1 s; it is -0.097 kN now");
  EXPECT_EQ(watched(wait, 3.5, [](double) { return std::nan(""); })->verdict(), Verdict::failed);
  Watch other({.channel = Watched::displacement, .tolerance = 1});
  recordings::Columns columns;
  columns.time = {0};
  other.see(columns.rows());
  EXPECT_EQ(other.reason(), "waits for the displacement, which the device does not measure");
}

struct LedgerTest : testing::Test {
  Folder folder;
  Ledger ledger{folder.path};
  Plan plan = plan_of(
      {{"name", "p"}, {"run", short_run()}, {"sweeps", {{{"set", "top"}, {"values", {1, 2, 3, 4}}}}}});

  std::vector<std::int64_t> order() {
    std::vector<std::int64_t> out;
    for (const auto& item : ledger.list(0, ItemState::waiting, 0, 1000).items) out.push_back(item.item);
    return out;
  }
};
using Ids = std::vector<std::int64_t>;

TEST_F(LedgerTest, ItemsMoveWhereTheyAreTold) {
  const auto added = ledger.add(plan);
  EXPECT_EQ(added.count, 4);
  EXPECT_EQ(order(), (Ids{1, 2, 3, 4}));
  ledger.move({.item = 4}, std::nullopt, true);
  EXPECT_EQ(order(), (Ids{4, 1, 2, 3}));
  ledger.move({.item = 4}, 3, false);
  EXPECT_EQ(order(), (Ids{1, 2, 4, 3}));
  ledger.move({.item = 1}, std::nullopt, false);
  EXPECT_EQ(order(), (Ids{2, 4, 3, 1}));
  const auto second = ledger.add(plan);
  EXPECT_EQ(ledger.move({.plan = second.plan}, 4, false), 4);
  EXPECT_EQ(order(), (Ids{2, 5, 6, 7, 8, 4, 3, 1}));
  // What runs stays where it is, and nothing goes before it.
  ledger.begin(2, "r", "rec");
  ledger.move({.item = 1}, std::nullopt, true);
  EXPECT_EQ(order(), (Ids{1, 5, 6, 7, 8, 4, 3}));
  EXPECT_EQ(ledger.list(0, std::nullopt, 0, 1).items.front().item, 2);
  EXPECT_EQ(code_of([&] { ledger.move({.item = 2}, std::nullopt, true); }), ErrorCode::bad_state);
  EXPECT_EQ(code_of([&] { ledger.move({.item = 1}, 2, false); }), ErrorCode::bad_state);
  EXPECT_EQ(code_of([&] { ledger.move({.item = 99}, std::nullopt, true); }), ErrorCode::not_found);
}

// Always into the same gap: it is used up again and again.
TEST_F(LedgerTest, ThereIsAlwaysRoomBetweenTwo) {
  ledger.add(plan);
  for (int i = 0; i < 100; ++i) {
    ledger.move({.item = i % 2 == 0 ? 1 : 2}, 4, false);
    const auto now = order();
    ASSERT_EQ(now, i % 2 == 0 ? (i == 0 ? Ids{2, 3, 1, 4} : Ids{3, 2, 1, 4}) : (Ids{3, 1, 2, 4})) << i;
  }
}

TEST_F(LedgerTest, WhatIsUnderWayIsNotForgotten) {
  ledger.add(plan);
  ledger.begin(1, "r", "rec");
  EXPECT_EQ(code_of([&] { ledger.remove({.item = 1}); }), ErrorCode::busy);
  EXPECT_EQ(code_of([&] { ledger.remove({.plan = 1}); }), ErrorCode::busy);
  EXPECT_EQ(ledger.remove({.item = 2}), 1);
  ledger.finish(1, "r", ItemState::complete, ItemState::complete, "", true);
  EXPECT_EQ(ledger.remove({.plan = 1}), 3);
  EXPECT_EQ(code_of([&] { ledger.entries(1); }), ErrorCode::not_found);
}

TEST_F(LedgerTest, AnotherOneFindsItAllAgain) {
  ledger.add(plan);
  ledger.begin(1, "run-1", "rec-1");
  ledger.set_state({.started = true});
  ledger.set_up(1, {{"top", 1}});
  Ledger next(folder.path);
  EXPECT_TRUE(next.state().started);
  const auto running = next.running();
  ASSERT_EQ(running.size(), 1u);
  EXPECT_EQ(running[0].item.run, "run-1");
  EXPECT_EQ(running[0].item.recording, "rec-1");
  EXPECT_EQ(running[0].step.values, (std::vector<json>{1}));
  EXPECT_EQ(running[0].set_up, (json{{"top", 1}}));
  next.put_back(1, "run-1");
  EXPECT_EQ(next.next()->item.item, 1);
  EXPECT_EQ(next.next()->item.runs, 0);
  EXPECT_EQ(next.next()->item.run, "");
}

TEST(QueueFile, ADamagedOneIsNamed) {
  const Folder folder;
  std::ofstream(folder.path / "queue.db") << std::string(5000, 'x');
  EXPECT_EQ(code_of([&] { Ledger ledger(folder.path); }), ErrorCode::io_error);
  std::filesystem::remove(folder.path / "queue.db");
  std::ofstream(folder.path / "precious") << "";
  std::filesystem::create_symlink(folder.path / "precious", folder.path / "queue.db");
  EXPECT_EQ(code_of([&] { Ledger ledger(folder.path); }), ErrorCode::io_error) << "a link is not followed";
}

class QueueTest : public EngineTest {
 protected:
  std::shared_ptr<Queue> queue = std::make_shared<Queue>(engine);
  Dispatcher rpc;
  CallContext caller{.client = "test", .lease = "", .subscriber = nullptr};

  void SetUp() override { add_all_methods(rpc, engine, queue); }
  void TearDown() override {
    queue->close();
    engine.stop();
    queue->end();
  }
  json call(const char* method, const json& params = json::object()) {
    return rpc.call(method, params, caller);
  }
  std::int64_t add(json plan) { return call("queue.add", {{"plan", std::move(plan)}}).at("first_item"); }
  template <class Condition>
  void until(Condition condition) {
    for (int i = 0; i < 4000 && !condition(); ++i) usleep(5000);
    EXPECT_TRUE(condition()) << call("queue.list").dump(2);
  }
  void until_stopped() {
    until([&] { return queue->status().state == QueueActivity::stopped && queue->status().item == 0; });
  }
  QueueItem item(std::int64_t id) { return queue->ledger().entry(id).item; }
};

TEST_F(QueueTest, RunsWhatWaitsInItsOrderAndRestsWhenItIsEmpty) {
  add({{"run", short_run()}, {"sweeps", {{{"set", "top"}, {"values", {0.2, 0.4}}}}}});
  const auto last = add({{"run", short_run()}, {"name", "urgent"}});
  call("queue.move", {{"item", last}, {"first", true}});
  EXPECT_EQ(code_of([&] { call("queue.start"); }), ErrorCode::bad_state) << "nobody has opened it";
  EXPECT_EQ(queue->open(), "");
  EXPECT_EQ(engine.status().state, RunState::idle) << "nothing starts by itself";
  call("queue.start");
  until_stopped();
  EXPECT_EQ(queue->status().reason, "the queue is empty");
  const auto listed = call("queue.list");
  EXPECT_EQ(listed.at("counts").at("complete"), 3);
  std::vector<json> tops;
  for (const auto& row : listed.at("items")) {
    const auto recording = recordings::read_summary(engine.store().recording(row.at("recording")).string());
    EXPECT_EQ(recording.header.entry_identifier, row.at("run"));
    EXPECT_EQ(recording.status, "complete");
    tops.push_back(recording.header.protocol.at("parameters").at("top"));
  }
  EXPECT_EQ(json(tops), json::parse("[0.5, 0.2, 0.4]"));
  EXPECT_EQ(engine.runs().size(), 3u);
  EXPECT_EQ(code_of([&] { call("queue.start"); }), ErrorCode::bad_state) << "nothing waits";
}

TEST_F(QueueTest, AStopOfItsRunStopsTheQueue) {
  queue->open();
  const auto first =
      add({{"run", {{"protocol", trapezium(0.1, 60)}, {"model", "soft-pzt"}}}, {"repeats", 2}});
  call("queue.start");
  await({RunState::running});
  EXPECT_EQ(code_of([&] { call("queue.remove", {{"item", first}}); }), ErrorCode::busy);
  call("run.abort");
  until_stopped();
  EXPECT_EQ(queue->status().reason, "stopped by test");
  EXPECT_EQ(item(first).state, ItemState::aborted);
  EXPECT_EQ(item(first + 1).state, ItemState::waiting);
  until([&] { return !queue->ledger().state().started; });
  EXPECT_TRUE(engine.status().output_at_zero);
}

TEST_F(QueueTest, AStopBetweenTwoRunsStopsItToo) {
  queue->open();
  const auto first =
      add({{"run", short_run()},
           {"sweeps", {{{"set", "prestress_MPa"}, {"values", {4}}, {"confirm", "set {} MPa"}}}}});
  call("queue.start");
  until([&] { return queue->status().state == QueueActivity::asks; });
  EXPECT_EQ(call("run.abort").at("state"), "idle");
  until_stopped();
  EXPECT_EQ(code_of([&] { call("queue.confirm", {{"item", first}}); }), ErrorCode::bad_state);
  EXPECT_EQ(item(first).state, ItemState::waiting);
  EXPECT_EQ(code_of([&] { call("run.abort"); }), ErrorCode::bad_state) << "nothing to stop";
}

TEST_F(QueueTest, AsksOnceForEachValueThatAPersonSets) {
  queue->open();
  const auto first =
      add({{"run", short_run()},
           {"repeats", 2},
           {"sweeps",
            {{{"set", "prestress_MPa"}, {"values", {4, 8}}, {"confirm", "set the prestress to {} MPa"}}}}});
  call("queue.start");
  until([&] { return queue->status().state == QueueActivity::asks; });
  EXPECT_EQ(queue->status().confirm, "set the prestress to 4 MPa");
  EXPECT_EQ(code_of([&] { call("queue.confirm", {{"item", first + 1}}); }), ErrorCode::bad_state);
  // Another one goes first: what is asked for is what it needs.
  call("queue.move", {{"item", first + 2}, {"first", true}});
  until([&] { return queue->status().item == first + 2; });
  EXPECT_EQ(queue->status().confirm, "set the prestress to 8 MPa");
  call("queue.move", {{"item", first + 2}, {"before", first + 3}});
  until([&] { return queue->status().item == first; });
  call("queue.confirm", {{"item", first}});
  until([&] { return queue->status().state == QueueActivity::asks && queue->status().item == first + 2; });
  EXPECT_EQ(item(first + 1).state, ItemState::complete);
  EXPECT_EQ(engine.runs().size(), 2u);
  call("queue.stop");
  call("queue.start");
  until([&] { return queue->status().state == QueueActivity::asks; });
  call("queue.confirm", {{"item", first + 2}});
  until_stopped();
  EXPECT_EQ(item(first + 3).state, ItemState::complete);
}

TEST_F(QueueTest, StopsAfterAsManyFailuresAsThePlanAllows) {
  queue->open();
  const json refused{{"device", "replay:gone"}};
  std::ofstream(engine.store().recordings() / "gone.h5") << "no recording";
  const auto first = add({{"run", refused}, {"repeats", 3}, {"stop_after_failures", 2}});
  call("queue.start");
  until_stopped();
  EXPECT_EQ(item(first).state, ItemState::failed);
  EXPECT_EQ(item(first + 1).state, ItemState::failed);
  EXPECT_EQ(item(first + 2).state, ItemState::waiting);
  EXPECT_NE(queue->status().reason.find("failed"), std::string::npos) << queue->status().reason;
}

TEST_F(QueueTest, ALimitThatTripsStopsIt) {
  queue->open();
  // Less than the stack moves: it trips on the way up.
  const auto first = add({{"run", short_run()}, {"repeats", 2}, {"stop_after_failures", 0}});
  call("limits.set", {{"displacement_max", 1e-7}});
  call("queue.start");
  until_stopped();
  EXPECT_EQ(item(first).state, ItemState::failed);
  EXPECT_EQ(item(first + 1).state, ItemState::waiting);
  EXPECT_NE(queue->status().reason.find("a limit tripped"), std::string::npos) << queue->status().reason;
}

TEST_F(QueueTest, WaitsForTheRunOfSomebodyElse) {
  queue->open();
  const auto other = engine.start(request(trapezium(0.1, 60), false)).run;
  const auto first = add({{"run", short_run()}});
  call("queue.start");
  until([&] { return queue->status().state == QueueActivity::waits && queue->status().item == first; });
  EXPECT_EQ(item(first).runs, 0);
  engine.abort(other, "enough");  // not by run.abort: the queue goes on
  until_stopped();
  EXPECT_EQ(item(first).state, ItemState::complete);
}

// Of the force of 4 MPa on 25 mm^2.
json wait_for_force(double value, double lasting, double timeout) {
  return {{"channel", "force"}, {"value", value},   {"tolerance", 2},
          {"unit", "N"},        {"for_s", lasting}, {"timeout_s", timeout}};
}
json prestressed(bool fast) {
  auto run = short_run(fast);
  run["set"] = {{"prestress_MPa", 4}, {"sample_rate_Hz", 150}};
  return run;
}

TEST_F(QueueTest, BeginsARunWhenItsConditionHasCome) {
  queue->open();
  const auto first = add({{"run", prestressed(true)},
                          {"wait", wait_for_force(98, 20, 60)},
                          {"sweeps", {{{"set", "top"}, {"values", {0.2, 0.4}}}}}});
  const auto real = add({{"run", prestressed(false)}, {"wait", wait_for_force(98, 0.3, 5)}});
  call("queue.start");
  until_stopped();
  EXPECT_EQ(queue->status().reason, "the queue is empty");
  for (const auto id : {first, first + 1, real})
    EXPECT_EQ(item(id).state, ItemState::complete) << item(id).reason;
  EXPECT_EQ(engine.runs().size(), 6u);
  EXPECT_EQ(engine.store().recording_names().size(), 3u) << "waits leave none";
}

TEST_F(QueueTest, AConditionThatDoesNotComeIsAFailure) {
  queue->open();
  const auto first =
      add({{"run", prestressed(false)}, {"wait", wait_for_force(150, 0.2, 0.6)}, {"repeats", 2}});
  call("queue.start");
  until(
      [&] { return queue->status().reason.starts_with("for force within 2 N of 150 N for 0.2 s; it is 9"); });
  EXPECT_EQ(queue->status().state, QueueActivity::waits);
  until_stopped();
  EXPECT_EQ(item(first).state, ItemState::failed);
  EXPECT_TRUE(item(first).reason.starts_with("waited 0.6 s for force within 2 N of 150 N"))
      << item(first).reason;
  EXPECT_EQ(item(first + 1).state, ItemState::waiting);
  EXPECT_NE(queue->status().reason.find("waited 0.6 s"), std::string::npos) << queue->status().reason;
  const auto kept = recordings::read_recording(engine.store().recording(item(first).recording).string());
  EXPECT_EQ(kept.status, "aborted");
  EXPECT_EQ(std::ranges::count(kept.at(recordings::Channel::command), 0), kept.size())
      << "the output stays at zero";
  EXPECT_TRUE(engine.status().output_at_zero);
}

TEST_F(QueueTest, WhoStopsTheQueueStopsItsWait) {
  queue->open();
  const auto first = add({{"run", prestressed(false)}, {"wait", wait_for_force(150, 0.2, 600)}});
  const auto second = add({{"run", short_run()}});
  const auto waits = [&] {
    return queue->status().state == QueueActivity::waits && engine.status().state == RunState::running;
  };
  for (const auto* stop : {"queue.stop", "run.abort"}) {
    call("queue.start");
    until(waits);
    call(stop);
    until_stopped();
    until([&] { return is_over(engine.status().state); });
    EXPECT_EQ(item(first).state, ItemState::waiting) << stop;
    EXPECT_EQ(item(first).runs, 0);
  }
  call("queue.start");
  until(waits);
  call("queue.move", {{"item", second}, {"first", true}});
  until([&] { return item(second).state == ItemState::complete; });
  until(waits);
  call("queue.remove", {{"item", first}});
  until_stopped();
  EXPECT_EQ(queue->status().reason, "the queue is empty");
}

TEST_F(QueueTest, WhatCannotRunIsNotTaken) {
  const auto refused = [&](json plan, const char* place) {
    try {
      add(std::move(plan));
      ADD_FAILURE() << place;
    } catch (const Error& error) {
      ASSERT_FALSE(error.problems().empty()) << error.what();
      EXPECT_EQ(error.problems().front().path, place) << error.what();
    }
  };
  refused({{"run", short_run()}, {"sweeps", {{{"set", "tip"}, {"values", {1}}}}}}, "/plan/sweeps/0");
  refused({{"run", {{"protocol", "full-lops"}}}}, "/plan/run/protocol");
  refused({{"run", short_run()}, {"sweeps", {{{"set", "top"}, {"values", {0.1, 50}}}}}},
          "/plan/run/protocol/segments/0/level");
  refused({{"run", {{"protocol", "full-loops"}, {"device", "vitual"}}}}, "/plan/run/device");
  EXPECT_EQ(code_of([&] { call("queue.add"); }), ErrorCode::invalid_params);
  EXPECT_EQ(call("queue.list").at("total"), 0);
}

// As if the daemon had died at once after the item was marked.
TEST_F(QueueTest, ARestartGoesOnWhereThePlanSaysSo) {
  json plan{{"run", short_run()}, {"repeats", 2}, {"resume", "automatic"}, {"repeat_broken", 1}};
  const auto first = add(plan);
  queue->ledger().confirm_plans();
  queue->ledger().begin(first, "gone", "never-made");
  queue->ledger().set_state({.started = true});
  EXPECT_NE(queue->open().find("nothing was recorded"), std::string::npos);
  until_stopped();
  EXPECT_EQ(item(first).state, ItemState::complete);
  EXPECT_EQ(item(first).runs, 2);
  EXPECT_EQ(item(first + 1).runs, 1);
  const auto runs = queue->ledger().runs(first);
  ASSERT_EQ(runs.size(), 2u);
  EXPECT_EQ(runs[0].state, ItemState::broken_off);
  EXPECT_EQ(runs[0].recording, "");
}

TEST_F(QueueTest, ARestartStartsNothingThatNobodyConfirmed) {
  const auto first = add({{"run", short_run()}, {"repeats", 3}, {"resume", "automatic"}});
  queue->ledger().begin(first, "gone", "never-made");
  queue->ledger().set_state({.started = true});  // before the plan was added, say
  queue->open();
  until_stopped();
  EXPECT_NE(queue->status().reason.find("does not go on by itself"), std::string::npos);
  EXPECT_EQ(item(first).state, ItemState::broken_off) << "nobody asked for a repetition";
  EXPECT_EQ(item(first + 1).state, ItemState::waiting);
  EXPECT_TRUE(engine.runs().empty());
  call("queue.start");
  until_stopped();
  EXPECT_EQ(item(first).state, ItemState::broken_off);
  EXPECT_EQ(item(first + 2).state, ItemState::complete);
}

TEST_F(QueueTest, ARestartTakesARecordingAtItsWord) {
  const auto first = add({{"run", short_run()}, {"repeats", 2}});
  RunRequest done = request(trapezium(0.1, 0.1), true);
  done.id = "0e8c9f6e-7f2d-4f8e-9d5c-2b1a0c3d4e5f";
  RunStatus status;
  {  // that this engine knows nothing of
    Hub elsewhere;
    Engine before(folder.path, elsewhere);
    status = before.wait(before.start(done).run);
  }
  queue->ledger().begin(first, done.id, status.recording);
  queue->ledger().begin(first + 1, "another", status.recording);
  queue->open();
  EXPECT_EQ(item(first).state, ItemState::complete);
  EXPECT_EQ(item(first + 1).state, ItemState::broken_off) << "the recording is another run's";
}

TEST(QueueHooks, AProgramIsToldAndOnlyThat) {
  const Folder folder;
  const auto script = (folder.path / "tell").string(), told = (folder.path / "told").string();
  std::ofstream(script) << "#!/bin/sh\nprintf '%s %s %s\\n' \"$1\" \"$2\" \"$(ls /proc/self/fd | wc -l)\" >> "
                        << told << "\n";
  std::filesystem::permissions(script, std::filesystem::perms::owner_all);
  const auto refused = [](const std::string& hook) {
    return code_of([&] { Hooks({hook}, [](const std::string&) {}); });
  };
  EXPECT_EQ(refused("run_ended"), ErrorCode::invalid_params);
  EXPECT_EQ(refused("sunrise=" + script), ErrorCode::invalid_params);
  EXPECT_EQ(refused("run_ended=" + script + "-not"), ErrorCode::invalid_params);
  std::mutex mutex;
  std::string complaint;
  const auto complained = [&] {
    const std::scoped_lock lock(mutex);
    return complaint;
  };
  Hooks hooks({"run_ended=" + script, "queue_empty=/bin/false"}, [&](const std::string& text) {
    const std::scoped_lock lock(mutex);
    complaint = text;
  });
  hooks.tell(HookEvent::run_ended, {{"item", 7}});
  hooks.tell(HookEvent::queue_stopped, {{"reason", "nobody asked for this"}});
  hooks.tell(HookEvent::queue_empty, {});
  for (int i = 0; i < 4000 && complained().empty(); ++i) usleep(5000);
  EXPECT_EQ(complained(), "/bin/false, told of queue_empty, ended with 1");
  std::ifstream in(told);
  const std::string text{std::istreambuf_iterator<char>(in), {}};
  // Standard input, output and error, and the folder that ls lists.
  EXPECT_EQ(text, "run_ended {\"item\":7} 4\n");
}

// Takes one request and answers it. What it was is said once it is over.
std::string take_request(int listening, const std::string& answer) {
  const recordings::Descriptor caller(accept(listening, nullptr, nullptr));
  std::string text;
  for (std::array<char, 4096> bytes{}; !text.ends_with("}}");) {
    const auto got = read(caller.get(), bytes.data(), bytes.size());
    if (got <= 0) break;
    text.append(bytes.data(), static_cast<std::size_t>(got));
  }
  EXPECT_EQ(write(caller.get(), answer.data(), answer.size()), static_cast<ssize_t>(answer.size()));
  return text;
}

TEST(QueueHooks, AnAddressIsToldByPost) {
  const recordings::Descriptor listening(socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0));
  sockaddr_in place{
      .sin_family = AF_INET, .sin_port = 0, .sin_addr = {htonl(INADDR_LOOPBACK)}, .sin_zero = {}};
  socklen_t size = sizeof place;
  ASSERT_EQ(bind(listening.get(), reinterpret_cast<sockaddr*>(&place), size), 0);
  ASSERT_EQ(listen(listening.get(), 4), 0);
  ASSERT_EQ(getsockname(listening.get(), reinterpret_cast<sockaddr*>(&place), &size), 0);
  const auto address = "http://127.0.0.1:" + std::to_string(ntohs(place.sin_port)) + "/night";
  std::promise<std::string> complaint;
  Hooks hooks({"run_ended=" + address, "queue_empty=" + address},
              [&](const std::string& text) { complaint.set_value(text); });
  hooks.tell(HookEvent::run_ended, {{"item", 7}});
  const auto told = take_request(listening.get(), "HTTP/1.1 204 No Content\r\n\r\n");
  EXPECT_TRUE(told.starts_with("POST /night HTTP/1.1\r\n")) << told;
  EXPECT_TRUE(told.ends_with("{\"event\": \"run_ended\", \"facts\": {\"item\":7}}")) << told;
  hooks.tell(HookEvent::queue_empty, {{"item", 7}});
  take_request(listening.get(), "HTTP/1.1 403 Forbidden\r\nContent-Length: 0\r\n\r\n");
  EXPECT_EQ(complaint.get_future().get(), address + ", told of queue_empty, did not take it");
}

TEST_F(QueueTest, TenThousandItemsAreNoBurden) {
  using Clock = std::chrono::steady_clock;
  const auto ms = [](auto&& act) {
    const auto begin = Clock::now();
    act();
    return std::chrono::duration<double, std::milli>(Clock::now() - begin).count();
  };
  Plan plan;
  plan.name = "many";
  plan.run.request.protocol = trapezium(0.1, 0.1);
  plan.repeats = 10'000;
  queue->ledger().add(plan);  // by itself: each of them would be checked against the model
  const auto run = json{{"run", short_run()}};
  constexpr int times = 21;
  std::vector<double> adds;
  for (int i = 0; i < times; ++i) adds.push_back(ms([&] { call("queue.add", run); }));
  std::ranges::sort(adds);
  json listed;
  const double list = ms([&] { listed = call("queue.list"); });
  const double last = ms([&] { call("queue.list", {{"first", 9900}}); });
  const double move = ms([&] { call("queue.move", {{"item", 10'001}, {"first", true}}); });
  EXPECT_EQ(listed.at("total"), 10'000 + times);
  EXPECT_EQ(listed.at("items").size(), 100u);
  EXPECT_EQ(call("queue.list").at("items").front().at("item"), 10'001);
  std::printf("10,000 items: add %.1f ms, list %.1f ms, its last page %.1f ms, move %.1f ms\n",
              adds[times / 2], list, last, move);
}

}  // namespace
}  // namespace ferrobench::server

#include <cmath>
#include <future>

#include "engine_bench.h"
#include "model/inference/study/discover.h"
#include "recordings/file/reader.h"
#include "server/engine/simulation.h"
#include "server/methods/methods.h"

namespace ferrobench::server {
namespace {

using recordings::Channel;

TEST_F(EngineTest, IsIdleBeforeItsFirstRun) {
  EXPECT_EQ(engine.status().state, RunState::idle);
  EXPECT_TRUE(engine.status().output_at_zero);
}

TEST_F(EngineTest, RecordsAWholeRun) {
  auto asked = request(trapezium(0.5, 1), true);
  asked.notes = "first try";
  asked.seed = 7;
  asked.set = {{"top", 1.0}, {"prestress_MPa", 4}};
  const auto status = finish(asked);
  ASSERT_EQ(status.state, RunState::complete) << status.reason;
  EXPECT_TRUE(status.output_at_zero);
  EXPECT_EQ(status.progress, 1);

  const auto r = recordings::read_recording(status.path);
  EXPECT_EQ(r.status, "complete");
  EXPECT_EQ(r.size(), 401u);
  EXPECT_EQ(static_cast<std::int64_t>(r.size()), status.rows);
  EXPECT_EQ(r.header.run_seed, 7);
  EXPECT_EQ(r.header.load.prestress, 4e6);
  EXPECT_EQ(r.header.model["load"]["prestress"], 4e6);
  EXPECT_EQ(r.header.protocol["parameters"]["top"], 1.0);
  EXPECT_DOUBLE_EQ(*std::ranges::max_element(r.at(Channel::command)), 1e6);
  EXPECT_EQ(r.at(Channel::command).back(), 0);
  ASSERT_EQ(r.segments.size(), 3u);
  EXPECT_EQ(r.segments[1].label, "the hold");
  EXPECT_EQ(r.segments[1].end_sample - r.segments[1].start_sample, 200);
  ASSERT_FALSE(r.events.empty());
  EXPECT_EQ(r.events[0].message, "first try");
  // Scaled values are what the raw counts say.
  ASSERT_TRUE(r.raw);
  const auto& column = r.raw->columns[0];
  EXPECT_DOUBLE_EQ(r.at(column.channel)[10],
                   column.offset + column.gain * r.raw->counts[10 * r.raw->columns.size()]);
}

// A fast ramp closely, a long hold by the decade: the device scans at one rate, and the file has what was
// asked for, which everybody reads like any other.
TEST_F(EngineTest, RecordsEachSegmentAsItAsks) {
  auto program = trapezium(0.1, 100);
  program["sample_rate_Hz"] = 50;
  program["segments"][0]["sample_rate_Hz"] = 1000;
  program["segments"][1]["readings_per_decade"] = 40;
  const auto status = finish(request(program, true));
  ASSERT_EQ(status.state, RunState::complete) << status.reason;
  EXPECT_EQ(status.sample_rate, 1000);
  EXPECT_EQ(status.rows, 100'201);
  EXPECT_EQ(status.rows, status.rows_expected);

  const auto r = recordings::read_recording(status.path);
  const protocols::SampledWaveform planned(protocols::Protocol::from_json(program).expand(), 1000, 50);
  EXPECT_EQ(r.size(), planned.recorded_size());
  EXPECT_EQ(static_cast<std::int64_t>(r.size()), status.rows_on_disk);
  ASSERT_EQ(r.segments.size(), 3u);
  const auto row = [&](std::int64_t i) { return static_cast<std::size_t>(i); };
  EXPECT_EQ(r.segments[1].start_sample, 100);
  EXPECT_EQ(r.time[row(r.segments[1].start_sample)], 0.1);
  EXPECT_EQ(r.time[row(r.segments[2].start_sample)], 100.1);
  EXPECT_EQ(r.time[row(r.segments[2].start_sample) + 1], 100.12);  // 50 a second
  const auto hold = r.segments[1].end_sample - r.segments[1].start_sample;
  // 50 a second until a fortieth of a decade is longer than that, after 0.34 s.
  EXPECT_NEAR(static_cast<double>(hold), 0.34 * 50 + 40 * std::log10(100 / 0.34), 3);
  for (std::size_t i = 0; i < r.size(); ++i)
    EXPECT_NEAR(r.at(Channel::command)[i], planned.waveform().value(r.time[i]), 1e-3);
  ASSERT_TRUE(r.raw);
  EXPECT_EQ(r.raw->counts.size(), r.size() * r.raw->columns.size());

  // The same samples as if all had been recorded.
  auto closely = program;
  closely["sample_rate_Hz"] = 1000;
  for (auto& segment : closely["segments"]) {
    segment.erase("sample_rate_Hz");
    segment.erase("readings_per_decade");
  }
  const auto all = recordings::read_recording(finish(request(closely, true)).path);
  ASSERT_EQ(all.size(), 100'201u);
  for (std::size_t i = 0; i < r.size(); ++i) {
    const auto same = static_cast<std::size_t>(std::lround(r.time[i] * 1000));
    EXPECT_EQ(r.time[i], all.time[same]);
    EXPECT_EQ(r.at(Channel::displacement)[i], all.at(Channel::displacement)[same]);
  }
}

// What the bench knows of the specimen before the first sample stands in the recording, and is simulated.
TEST_F(EngineTest, ARunSaysWhatTheSpecimenHadBeenThrough) {
  using protocols::Past;
  using protocols::PastKind;
  auto protocol = trapezium(0.1, 0.1);
  const auto fresh = recordings::read_recording(finish(request(protocol, true)).path);
  EXPECT_EQ(fresh.header.past, Past{PastKind::poled_plus});

  // Under a prestress the way to a first level towards + shows as well: 0.7 % of the range without it.
  protocol["start"] = 1;
  const auto above = recordings::read_recording(finish(request(protocol, true)).path);
  EXPECT_EQ(above.header.past.kind, PastKind::visited);
  const auto alike = simulate_recording(above, nullptr, "here").recording;
  const auto& measured = above.at(Channel::displacement);
  const auto [low, high] = std::ranges::minmax(measured);
  EXPECT_NEAR(alike.at(Channel::displacement)[0], measured[0], 1e-3 * (high - low));
  protocol["start"] = 0;

  protocol["past"] = {{"kind", "poled_minus"}};
  const auto minus = recordings::read_recording(finish(request(protocol, true)).path);
  EXPECT_EQ(minus.header.past, Past{PastKind::poled_minus});
  EXPECT_LT(minus.at(Channel::charge)[0], 0);
  const auto simulated = simulate_recording(minus, nullptr, "here");
  EXPECT_EQ(simulated.recording.header.past, minus.header.past);
  EXPECT_NEAR(simulated.recording.at(Channel::charge)[0], minus.at(Channel::charge)[0],
              1e-3 * std::abs(minus.at(Channel::charge)[0]));
  const auto otherwise = simulate_recording(minus, nullptr, "here", Past{PastKind::poled_plus});
  EXPECT_GT(otherwise.recording.at(Channel::charge)[0], 0);

  // So does the way to the program's first level, which is not recorded.
  protocol["start"] = 1.5;
  const auto led = recordings::read_recording(finish(request(protocol, true)).path);
  EXPECT_EQ(led.header.past.kind, PastKind::visited);
  EXPECT_EQ(led.header.past.from, protocols::FirstState::poled_minus);
  ASSERT_EQ(led.header.past.levels.size(), 1U);
  EXPECT_EQ(led.header.past.levels[0].field, 1.5e6);
  const auto played = simulate_recording(led, nullptr, "here");
  EXPECT_NEAR(played.recording.at(Channel::charge)[0], led.at(Channel::charge)[0],
              1e-2 * std::abs(led.at(Channel::charge)[0]));
  protocol["start"] = 0;

  // The device's configuration is nearer to the specimen than what the program says.
  auto asked = request(protocol, true);
  asked.set = {{"device.past", {{"kind", "unpoled"}}}};
  EXPECT_EQ(recordings::read_recording(finish(asked).path).header.past, Past{PastKind::unpoled});

  // A device that stays open remembers the run before.
  const auto id = engine.open_device("virtual", {{"model", "soft-pzt"}, {"clock", "fast"}});
  RunRequest again;
  again.protocol = trapezium(0.1, 0.1);
  again.device = id;
  finish(again);
  const auto second = recordings::read_recording(finish(again).path).header.past;
  EXPECT_EQ(second.kind, PastKind::visited);
  ASSERT_EQ(second.levels.size(), 3U);
  EXPECT_NEAR(second.levels[0].field, 5e5, 1);
  engine.close_device(id);
}

// The virtual device records its model and its noise; its own numerical error does not show.
TEST_F(EngineTest, NothingIsMissingInTheVirtualDevicesModel) {
  auto asked = request("creep-6-holds-stiff-spring", true);
  asked.set = {{"model.material.barrier", 5.3e4}, {"model.material.relaxation_time", 9.4e-3}};
  const auto run = finish(asked);
  ASSERT_EQ(run.state, RunState::complete) << run.reason;
  const auto found =
      model::discover(model::library_model("soft-pzt"), {{"holds", recordings::read_recording(run.path)}});
  EXPECT_EQ(found.verdict, model::Verdict::nothing_missing) << found.health.largest_left;
}

TEST_F(EngineTest, SameSeedSameSignals) {
  auto asked = request(trapezium(0.2, 0.5), true);
  const auto first = recordings::read_recording(finish(asked).path);
  const auto second = recordings::read_recording(finish(asked).path);
  asked.seed = 2;
  const auto third = recordings::read_recording(finish(asked).path);
  EXPECT_EQ(first.raw->counts, second.raw->counts);
  for (const auto channel : recordings::all_channels) EXPECT_EQ(first.at(channel), second.at(channel));
  EXPECT_NE(first.raw->counts, third.raw->counts);
  EXPECT_NE(first.header.entry_identifier, second.header.entry_identifier);
}

TEST_F(EngineTest, APauseInARampWaitsForTheHold) {
  engine.start(request(trapezium(0.6, 0.2), false));
  await({RunState::running});
  engine.pause("");
  EXPECT_EQ(engine.status().state, RunState::pausing);
  await({RunState::paused});
  usleep(300'000);
  EXPECT_EQ(engine.status().state, RunState::paused);
  engine.resume("");
  const auto status = await({RunState::complete, RunState::aborted});
  ASSERT_EQ(status.state, RunState::complete) << status.reason;

  const auto r = recordings::read_recording(status.path);
  ASSERT_EQ(r.segments.size(), 3u);
  EXPECT_GT(r.segments[1].end_sample - r.segments[1].start_sample, 40 + 40);
  std::vector<std::string> kinds;
  for (const auto& event : r.events) kinds.push_back(event.kind);
  EXPECT_EQ(std::ranges::count(kinds, "pause"), 1);
  EXPECT_EQ(std::ranges::count(kinds, "resume"), 1);
  EXPECT_GE(r.events[0].time, 0.6 - 1e-9);
  EXPECT_EQ(code_of([&] { engine.pause(""); }), ErrorCode::bad_state);
}

TEST_F(EngineTest, AbortIsASafeStop) {
  const auto started = engine.start(request(trapezium(0.4, 30), false));
  await({RunState::running});
  usleep(600'000);
  EXPECT_EQ(engine.abort("", "enough").run, started.run);
  const auto status = await({RunState::complete, RunState::aborted});
  EXPECT_EQ(status.state, RunState::aborted);
  EXPECT_EQ(status.reason, "enough");
  EXPECT_TRUE(status.output_at_zero);
  const auto r = recordings::read_recording(status.path);
  EXPECT_EQ(r.status, "aborted");
  EXPECT_EQ(r.reason, "enough");
  EXPECT_EQ(r.at(Channel::command).back(), 0);
  EXPECT_EQ(r.segments.back().label, "safe stop");
  EXPECT_EQ(code_of([&] { engine.abort("", "again"); }), ErrorCode::bad_state);
}

TEST_F(EngineTest, OfManyUnknownSettingsOnlyTheFirstAreTold) {
  auto asked = request(trapezium(0.1, 0.1), true);
  for (int i = 0; i < 20'000; ++i) asked.set["unheard_of_" + std::to_string(i)] = i;
  try {
    engine.start(asked);
    ADD_FAILURE();
  } catch (const Error& error) {
    EXPECT_EQ(error.problems().size(), max_problems);
  }
}

TEST_F(EngineTest, ASecondAbortHastensTheStop) {
  engine.set_limits({{"stop_slew", 1.6e5}});  // 3 s from 0.5 kV/mm
  engine.start(request(trapezium(0.2, 30), false));
  await({RunState::running});
  usleep(600'000);
  engine.abort("", "enough");
  usleep(300'000);
  EXPECT_EQ(engine.status().state, RunState::stopping);
  const auto begin = std::chrono::steady_clock::now();
  engine.abort("", "faster");
  const auto status = await({RunState::complete, RunState::aborted});
  EXPECT_LT(std::chrono::steady_clock::now() - begin, std::chrono::seconds(2));
  EXPECT_EQ(status.reason, "enough");
  EXPECT_TRUE(status.output_at_zero);
  const auto r = recordings::read_recording(status.path);
  ASSERT_GE(r.segments.size(), 2u);
  EXPECT_EQ(r.segments[r.segments.size() - 2].label, "safe stop");
  EXPECT_EQ(r.segments.back().label, "hastened stop");
  EXPECT_EQ(r.segments.back().rate, engine.limits().slew);
}

TEST_F(EngineTest, ALongerWayToZeroWantsAReason) {
  const auto before = write_json(engine.limits());
  for (const nlohmann::json& change : {nlohmann::json{{"stop_slew", 1}}, nlohmann::json{{"stop_time", 60}}})
    EXPECT_EQ(code_of([&] { engine.set_limits(change); }), ErrorCode::invalid_params) << change;
  EXPECT_EQ(write_json(engine.limits()), before);
  engine.set_limits({{"stop_time", 60}, {"stop_slew", 3e4}}, "the amplifier gives 1 mA");
  EXPECT_EQ(engine.limits().stop_slew, 3e4);
  engine.set_limits({{"stop_slew", 4e4}});  // the reason stands
}

TEST_F(EngineTest, ARunCanBeReadWhileItGoesOn) {
  engine.start(request(trapezium(0.4, 30), false));
  await({RunState::running});
  RunStatus status;
  for (int i = 0; i < 400 && (status = engine.status()).rows_on_disk < 100; ++i) usleep(20'000);
  EXPECT_GE(status.rows_on_disk, 100);
  EXPECT_LE(status.rows_on_disk, status.rows);
  const auto r = recordings::read_recording(status.path);
  EXPECT_EQ(r.status, "running");
  EXPECT_EQ(r.reason, "");
  EXPECT_GE(r.size(), static_cast<std::size_t>(status.rows_on_disk));
  EXPECT_EQ(engine.store().recording_names(), std::vector{status.recording});

  Dispatcher rpc;
  add_all_methods(rpc, engine);
  CallContext caller{.client = "test", .lease = "", .subscriber = nullptr};
  EXPECT_GT(rpc.call("recording.read", {{"name", status.recording}}, caller).at("rows").get<int>(), 99);
  const auto recovered = rpc.call("recording.recover", nlohmann::json::object(), caller).at("recordings");
  ASSERT_EQ(recovered.size(), 1u);
  EXPECT_EQ(recovered[0].at("outcome"), "running");
  EXPECT_EQ(code_of([&] {
              rpc.call("recording.delete", {{"name", status.recording}}, caller);
            }),
            ErrorCode::busy);
  EXPECT_EQ(code_of([&] {
              rpc.call("recording.annotate", {{"name", status.recording}, {"text", "x"}}, caller);
            }),
            ErrorCode::busy);
  engine.abort("", "enough");
  status = await({RunState::complete, RunState::aborted});
  EXPECT_EQ(status.rows_on_disk, status.rows);
  EXPECT_EQ(recordings::read_recording(status.path).size(), static_cast<std::size_t>(status.rows));
}

// A crash would now cost all of the recording, so nothing is promised any more and the run ends; nothing is
// lost.
TEST_F(EngineTest, ARunEndsWhoseJournalIsTakenAway) {
  engine.start(request(trapezium(0.4, 60), false));
  await({RunState::running});
  RunStatus status;
  for (int i = 0; i < 400 && (status = engine.status()).rows_on_disk < 50; ++i) usleep(20'000);
  std::filesystem::remove(status.path + ".journal");
  status = engine.wait(status.run);
  EXPECT_EQ(status.state, RunState::aborted);
  EXPECT_NE(status.reason.find("journal of the recording was removed"), std::string::npos) << status.reason;
  EXPECT_TRUE(status.output_at_zero);
  const auto r = recordings::read_recording(status.path);
  EXPECT_EQ(static_cast<std::int64_t>(r.size()), status.rows);
  EXPECT_GT(r.size(), 50u);
  EXPECT_EQ(r.at(Channel::command).back(), 0);
  EXPECT_TRUE(std::ranges::any_of(r.events, [](const auto& e) { return e.kind == "journal_gone"; }));
}

TEST_F(EngineTest, ShuttingDownStopsARunSafely) {
  std::string path;
  {
    Hub other;
    const Folder elsewhere;
    Engine second(elsewhere.path, other);
    path = folder.path / "left.h5";
    second.start(request(trapezium(0.4, 30), false), path);
    usleep(700'000);
  }
  const auto r = recordings::read_recording(path);
  EXPECT_EQ(r.status, "aborted");
  EXPECT_EQ(r.at(Channel::command).back(), 0);
}

// Waits for a self-test to have the device.
void await_test(Engine& engine, const std::string& id) {
  for (int i = 0; i < 2000; ++i) {
    try {
      engine.with_device(id, [](const daq::DeviceFacts&) {});
    } catch (const Error&) {
      return;
    }
    usleep(1000);
  }
  FAIL() << "no self-test began";
}

TEST_F(EngineTest, ASelfTestStopsLikeARunAndTheBenchAnswersMeanwhile) {
  const auto id = engine.open_device("virtual", {{"model", "soft-pzt"}});
  auto test = std::async(std::launch::async, [&] { return code_of([&] { engine.selftest(id); }); });
  await_test(engine, id);
  EXPECT_EQ(code_of([&] { engine.start(request(trapezium(0.2, 1), true)); }), ErrorCode::busy);
  EXPECT_EQ(code_of([&] { engine.selftest(id); }), ErrorCode::busy);
  EXPECT_EQ(code_of([&] { engine.close_device(id); }), ErrorCode::busy);
  EXPECT_EQ(code_of([&] { engine.set_limits(nlohmann::json::object()); }), ErrorCode::busy);
  EXPECT_EQ(engine.status().state, RunState::idle);
  usleep(900'000);  // the output is up
  engine.abort("", "enough");
  EXPECT_EQ(test.get(), ErrorCode::cancelled);
  engine.with_device(id, [](const daq::DeviceFacts& device) { EXPECT_EQ(device.output, 0); });
  EXPECT_TRUE(engine.selftest(id).passed);
}

TEST_F(EngineTest, ShuttingDownStopsASelfTest) {
  const auto id = engine.open_device("virtual", {{"model", "soft-pzt"}});
  auto test = std::async(std::launch::async, [&] { return code_of([&] { engine.selftest(id); }); });
  await_test(engine, id);
  engine.stop();
  EXPECT_EQ(test.get(), ErrorCode::cancelled);
  EXPECT_EQ(code_of([&] { engine.selftest(id); }), ErrorCode::bad_state);
}

TEST_F(EngineTest, RefusesBeforeAnythingMoves) {
  auto asked = request(trapezium(0.5, 1), true);
  asked.set = {{"top", 5}};
  EXPECT_EQ(code_of([&] { engine.start(asked); }), ErrorCode::limit_exceeded);
  asked.set = {{"sample_rate_Hz", 1e7}};
  EXPECT_EQ(code_of([&] { engine.start(asked); }), ErrorCode::invalid_params);
  asked.set = {{"sample_rate_Hz", -1}};
  EXPECT_EQ(code_of([&] { engine.start(asked); }), ErrorCode::invalid_params);
  EXPECT_TRUE(engine.store().recording_names().empty());
  EXPECT_EQ(engine.status().state, RunState::idle);
}

TEST_F(EngineTest, LimitsHoldForTheNextRun) {
  engine.set_limits({{"displacement_max", 5e-5}});
  engine.set_limits({{"field_max", 0.4e6}});
  EXPECT_EQ(engine.limits().displacement_max, 5e-5);  // what is not named stays
  EXPECT_EQ(code_of([&] { engine.start(request(trapezium(0.5, 1), true)); }), ErrorCode::limit_exceeded);
  EXPECT_EQ(code_of([&] { engine.set_limits({{"field_max", -1}}); }), ErrorCode::invalid_params);
  EXPECT_EQ(engine.limits().field_max, 0.4e6);
}

TEST_F(EngineTest, OneRunAtATimeAndAKeyStartsOnce) {
  auto asked = request(trapezium(0.2, 5), false);
  asked.idempotency_key = "monday";
  const auto first = engine.start(asked);
  EXPECT_EQ(engine.start(asked).run, first.run);
  EXPECT_EQ(code_of([&] { engine.start(request(trapezium(0.2, 5), false)); }), ErrorCode::busy);
  EXPECT_EQ(code_of([&] { engine.set_limits(nlohmann::json::object()); }), ErrorCode::busy);
  asked.seed = 3;
  EXPECT_EQ(code_of([&] { engine.start(asked); }), ErrorCode::invalid_params);
  engine.abort(first.run, "over");
  engine.wait(first.run);
  asked.seed = 1;
  EXPECT_EQ(engine.start(asked).run, first.run);
  EXPECT_EQ(engine.runs().size(), 1u);
}

TEST_F(EngineTest, AnOpenDeviceKeepsItsSpecimen) {
  const auto id = engine.open_device("virtual", {{"model", "soft-pzt"}, {"clock", "fast"}});
  RunRequest asked;
  asked.protocol = trapezium(0.5, 0.5);
  asked.device = id;
  asked.set = {{"top", -1.2}};
  const auto first = recordings::read_recording(finish(asked).path);
  const auto second = recordings::read_recording(finish(asked).path);
  // The first run depoles the virgin specimen; the second begins where the first ended.
  EXPECT_LT(second.at(Channel::charge).front(), 0.9 * first.at(Channel::charge).front());
  asked.set["prestress_MPa"] = 4;
  EXPECT_EQ(code_of([&] { engine.start(asked); }), ErrorCode::invalid_params);
  engine.close_device(id);
  EXPECT_EQ(code_of([&] { engine.close_device(id); }), ErrorCode::not_found);
}

TEST_F(EngineTest, SimulationAgreesWithTheDeviceItsRunWasMadeOn) {
  auto asked = request(trapezium(1, 2), true);
  asked.set = {{"top", -0.8},
               {"device.displacement.noise", 0},
               {"device.charge.noise", 0},
               {"device.force.noise", 0},
               {"device.field.noise", 0}};
  const auto measured = recordings::read_recording(finish(asked).path);
  const auto simulated = simulate_recording(measured, nullptr, "here");
  EXPECT_LT(simulated.quadrature_error, 1e-2);
  for (const auto channel : {Channel::charge, Channel::displacement, Channel::force}) {
    const auto &a = measured.at(channel), &b = simulated.recording.at(channel);
    const auto [low, high] = std::ranges::minmax(a);
    double sum = 0;
    for (std::size_t i = 0; i < a.size(); ++i) sum += (a[i] - b[i]) * (a[i] - b[i]);
    EXPECT_LT(std::sqrt(sum / static_cast<double>(a.size())), 1e-3 * (high - low))
        << recordings::channel_name(channel);
  }
  EXPECT_EQ(simulated.recording.segments.size(), 3u);
  EXPECT_EQ(simulated.recording.header.protocol, measured.header.protocol);
}

}  // namespace
}  // namespace ferrobench::server

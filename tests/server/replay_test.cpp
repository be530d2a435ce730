#include <fstream>

#include "engine_bench.h"
#include "recordings/file/reader.h"
#include "server/engine/rerun.h"
#include "server/engine/verify.h"
#include "server/methods/methods.h"

namespace ferrobench::server {
namespace {

using nlohmann::json;
using recordings::Channel;

RunRequest replay_of(const RunStatus& run) {
  RunRequest out;
  out.device = "replay:" + run.recording;
  out.fast = true;
  return out;
}

class ReplayRun : public EngineTest {
 protected:
  RunStatus measure() { return finish(request(trapezium(0.4, 0.5), true)); }
  json call(const std::string& method, const json& params) {
    Dispatcher rpc;
    add_all_methods(rpc, engine);
    CallContext caller{.client = "test", .lease = "", .subscriber = nullptr};
    return rpc.call(method, params, caller);
  }
};

TEST_F(ReplayRun, IsARunLikeAnyOther) {
  const auto first = measure();
  const auto second = finish(replay_of(first));
  ASSERT_EQ(second.state, RunState::complete) << second.reason;
  EXPECT_TRUE(second.output_at_zero);
  EXPECT_EQ(second.rows, first.rows);
  EXPECT_EQ(second.title, "Trapezium");
  const auto a = recordings::read_recording(first.path), b = recordings::read_recording(second.path);
  EXPECT_EQ(first_difference(a, b), std::nullopt);
  EXPECT_NE(a.header.entry_identifier, b.header.entry_identifier);
  EXPECT_EQ(b.header.device["source_identifier"], a.header.entry_identifier);
  EXPECT_EQ(b.header.device["recorded_with"]["driver"], "virtual");
  EXPECT_EQ(b.header.protocol, a.header.protocol);
  // And again, of the replay itself.
  EXPECT_EQ(first_difference(a, recordings::read_recording(finish(replay_of(second)).path)), std::nullopt);
}

TEST_F(ReplayRun, OfPausedAndAbortedRunsIsIdentical) {
  engine.start(request(trapezium(0.3, 30), false));
  await({RunState::running});
  engine.pause("");
  await({RunState::paused});
  usleep(300'000);
  engine.resume("");
  usleep(300'000);
  engine.abort("", "enough");
  const auto first = await({RunState::aborted});
  const auto second = finish(replay_of(first));
  EXPECT_EQ(second.state, RunState::complete) << second.reason;
  const auto a = recordings::read_recording(first.path);
  EXPECT_GE(a.events.size(), 3U);
  EXPECT_EQ(a.status, "aborted");
  EXPECT_EQ(first_difference(a, recordings::read_recording(second.path)), std::nullopt);
}

TEST_F(ReplayRun, ByRpcAWindowWithAnotherCalibration) {
  const auto first = measure();
  const auto started = call("replay.start", {{"recording", first.recording},
                                             {"fast", true},
                                             {"from_s", 0.5},
                                             {"to_s", 0.75},
                                             {"set", {{"device.force.gain", 2}}}});
  const auto second = engine.wait(started.at("run"));
  const auto a = recordings::read_recording(first.path), b = recordings::read_recording(second.path);
  ASSERT_EQ(b.size(), 51U);
  for (std::size_t i = 0; i < b.size(); ++i) {
    EXPECT_EQ(b.at(Channel::charge)[i], a.at(Channel::charge)[100 + i]);
    EXPECT_DOUBLE_EQ(b.at(Channel::force)[i], 2 * a.at(Channel::force)[100 + i]);
  }
  const auto difference = call("recording.compare", {{"a", first.recording}, {"b", second.recording}});
  EXPECT_EQ(difference["same_samples"], false);
  EXPECT_EQ(difference["columns"][0]["rows_b"], 51);
}

TEST_F(ReplayRun, CanBeOpenedAndStopped) {
  const auto first = measure();
  const auto id = engine.open_device("replay", {{"file", first.recording}, {"speed", 2}});
  RunRequest asked;
  asked.device = id;
  engine.start(asked);
  await({RunState::running});
  EXPECT_EQ(code_of([&] { engine.pause(""); }), ErrorCode::bad_state);
  engine.abort("", "enough");
  const auto status = await({RunState::aborted});
  EXPECT_EQ(status.reason, "enough");
  EXPECT_TRUE(status.output_at_zero);
  const auto second = finish(asked);
  EXPECT_EQ(first_difference(recordings::read_recording(first.path), recordings::read_recording(second.path)),
            std::nullopt);
}

TEST_F(ReplayRun, RefusesWhatItIsNot) {
  const auto first = measure();
  auto asked = replay_of(first);
  asked.protocol = "full-loops";
  EXPECT_EQ(code_of([&] { engine.start(asked); }), ErrorCode::invalid_params);
  asked = replay_of(first);
  asked.model = "soft-pzt";
  EXPECT_EQ(code_of([&] { engine.start(asked); }), ErrorCode::invalid_params);
  for (const auto& [key, value] : {std::pair<std::string, json>{"prestress_MPa", 4},
                                   {"device.file", "/etc/passwd"},
                                   {"device.force.gian", 2},
                                   {"device.from", 7},
                                   {"device.speed", 0}}) {
    asked = replay_of(first);
    asked.set = {{key, value}};
    EXPECT_EQ(code_of([&] { engine.start(asked); }), ErrorCode::invalid_params) << key;
  }
  asked = {};
  for (const auto* name : {"replay:../secret", "replay:/etc/passwd", "replay:", "replay"}) {
    asked.device = name;
    EXPECT_EQ(code_of([&] { engine.start(asked); }), ErrorCode::invalid_params) << name;
  }
  asked.device = "replay:nothing";
  EXPECT_EQ(code_of([&] { engine.start(asked); }), ErrorCode::not_found);
  EXPECT_EQ(code_of([&] { engine.open_device("replay", {{"file", "../x.h5"}}); }), ErrorCode::invalid_params);
  EXPECT_EQ(code_of([&] { engine.open_device("replay", json::object()); }), ErrorCode::invalid_params);
  asked = {};
  EXPECT_EQ(code_of([&] { engine.start(asked); }), ErrorCode::invalid_params);  // no program
  EXPECT_EQ(engine.store().recording_names().size(), 1U);
}

TEST_F(ReplayRun, DamagedFilesAreRefusedOrReplayed) {
  const auto first = measure();
  std::ifstream file(first.path, std::ios::binary);
  const std::string whole{std::istreambuf_iterator<char>(file), {}};
  std::uint32_t random = 7;
  int refused = 0;
  for (int i = 0; i < 40; ++i) {
    auto bytes = whole;
    for (int k = 0; k < 4; ++k) {
      random = random * 1664525 + 1013904223;
      bytes[random % bytes.size()] ^= static_cast<char>(1 << (random >> 29));
    }
    if (i % 4 == 0) bytes.resize(random % bytes.size());
    const auto path = engine.store().recordings() / "damaged.h5";
    std::ofstream(path, std::ios::binary) << bytes;
    RunRequest asked;
    asked.device = "replay:damaged";
    asked.fast = true;
    try {
      EXPECT_TRUE(finish(asked).output_at_zero);
    } catch (const Error&) {
      ++refused;
    }
  }
  EXPECT_GT(refused, 10);
}

TEST_F(ReplayRun, RerunFromTheFileAloneIsIdentical) {
  auto asked = request(trapezium(0.4, 0.5), true);
  asked.seed = 11;
  asked.set = {{"top", 0.7},
               {"prestress_MPa", 6},
               {"sample_rate_Hz", 300},
               {"device.tolerance", 1e-3},
               {"device.force.enabled", false},
               {"device.charge.noise", 1e-7},
               {"device.domains", 64}};
  const auto a = recordings::read_recording(finish(asked).path);
  const auto b = recordings::read_recording(finish(rerun_request(a)).path);
  EXPECT_EQ(first_difference(a, b), std::nullopt);
  EXPECT_EQ(b.header.device["rerun_of"], a.header.entry_identifier);
  auto other = a;
  other.header.run_seed = 12;
  const auto c = recordings::read_recording(finish(rerun_request(other)).path);
  EXPECT_NE(first_difference(a, c), std::nullopt);
}

TEST_F(ReplayRun, RerunSaysWhatIsMissing) {
  const auto good = recordings::read_recording(measure().path);
  const auto place = [](const recordings::Recording& r) {
    try {
      rerun_request(r);
    } catch (const Error& error) {
      return error.problems().at(0).path;
    }
    return std::string();
  };
  auto r = good;
  r.header.device = nullptr;
  EXPECT_EQ(place(r), "/entry/instrument/device");
  r.header.device = {{"driver", "replay"}, {"source", "x"}};
  EXPECT_EQ(place(r), "/entry/instrument/device");
  r = good;
  r.header.protocol = nullptr;
  EXPECT_EQ(place(r), "/entry/protocol");
  r = good;
  r.header.run_seed.reset();
  EXPECT_EQ(place(r), "/entry/run_seed");
  r = good;
  r.header.model = "text";
  EXPECT_EQ(place(r), "/entry/model");
}

TEST_F(ReplayRun, TheFirstDifferenceIsShownWithBothValues) {
  const auto a = recordings::read_recording(measure().path);
  auto b = a;
  b.channels[static_cast<std::size_t>(Channel::force)]->at(17) = 1.5;
  auto found = first_difference(a, b);
  ASSERT_TRUE(found);
  EXPECT_NE(found->find("/entry/data/force, row 17: "), std::string::npos) << *found;
  EXPECT_NE(found->find(" and 1.5 N"), std::string::npos) << *found;
  b = a;
  b.segments[1].label = "another";
  found = first_difference(a, b);
  ASSERT_TRUE(found);
  EXPECT_EQ(*found, "/segments/1/label: \"the hold\" and \"another\"");
  b = a;
  b.header.load.prestress *= 2;
  EXPECT_EQ(first_difference(a, b), "the report");
}

}  // namespace
}  // namespace ferrobench::server

// The parts of the engine that need no run: settings, the lease, jobs, live samples, the recorder, CSV.
#include <cmath>

#include "engine_bench.h"
#include "recordings/analysis/thinning.h"
#include "recordings/disk/new_file.h"
#include "recordings/file/reader.h"
#include "recordings/file/recover.h"
#include "server/bench/recorder.h"
#include "server/engine/live.h"
#include "server/methods/methods.h"
#include "tests/recordings/uneven_rows.h"

namespace ferrobench::server {
namespace {

using nlohmann::json;
using recordings::Channel;

std::vector<Problem> problems_of(const std::function<void()>& act) {
  try {
    act();
  } catch (const Error& error) {
    return error.problems();
  }
  ADD_FAILURE() << "nothing was thrown";
  return {};
}

TEST_F(EngineTest, SettingsReachProtocolLoadModelAndDevice) {
  auto asked = request(trapezium(1, 1), true);
  asked.set = {{"top", 0.7},
               {"spring_stiffness_N_per_m", 5.9e6},
               {"model.material.barrier", 4e4},
               {"sample_rate_Hz", 77},
               {"device.force.noise", 0.5}};
  const auto plan = make_plan(asked, engine.store());
  EXPECT_EQ(plan.protocol.parameters().at("top"), 0.7);
  EXPECT_EQ(plan.model["load"]["spring_stiffness"], 5.9e6);
  EXPECT_EQ(plan.model["material"]["barrier"], 4e4);
  EXPECT_EQ(plan.sample_rate, 77);
  EXPECT_EQ(plan.device_config["force"]["noise"], 0.5);
  EXPECT_EQ(plan.device_config["clock"], "fast");
}

TEST_F(EngineTest, TheLoadIsTheSetOneElseTheProtocolsElseTheModels) {
  auto asked = request(trapezium(1, 1), true);
  EXPECT_EQ(make_plan(asked, engine.store()).model["load"]["prestress"], 8e6);
  asked.protocol["load"] = {{"prestress_Pa", 3e6}};
  EXPECT_EQ(make_plan(asked, engine.store()).model["load"]["prestress"], 3e6);
  asked.set = {{"prestress_MPa", 2}};
  EXPECT_EQ(make_plan(asked, engine.store()).model["load"]["prestress"], 2e6);
}

TEST_F(EngineTest, VoltsActOnTheSpecimensOwnLayers) {
  auto protocol = trapezium(1, 1);
  protocol["unit"] = "V";
  protocol["layer_thickness_m"] = 1e-4;
  auto asked = request(protocol, true);
  asked.set = {{"top", 50}, {"model.actuator.layer_thickness", 5e-5}};
  EXPECT_DOUBLE_EQ(make_plan(asked, engine.store()).protocol.expand().maximum(), 1e6);
}

TEST_F(EngineTest, AMistypedSettingIsExplained) {
  auto asked = request(trapezium(1, 1), true);
  for (const auto& [typo, meant] : std::vector<std::pair<std::string, std::string>>{
           {"prestress_MpA", "prestress_MPa"},
           {"toq", "top"},
           {"model.material.barier", "model.material.barrier"}}) {
    asked.set = {{typo, 1}};
    const auto problems = problems_of([&] { make_plan(asked, engine.store()); });
    ASSERT_EQ(problems.size(), 1u);
    EXPECT_NE(problems[0].hint.find("\"" + meant + "\""), std::string::npos) << problems[0].hint;
    EXPECT_GT(problems[0].allowed.size(), 5u);
  }
  asked.set = {{"top", "high"}};
  EXPECT_EQ(problems_of([&] { make_plan(asked, engine.store()); }).at(0).path, "/set/top");
}

TEST_F(EngineTest, NamesFromOutsideStayInTheFolder) {
  for (const auto* name : {"../token", "/etc/passwd", "", ".hidden", "a/b", "a\nb"})
    EXPECT_EQ(code_of([&] { (void)engine.store().recording(name); }), ErrorCode::invalid_params) << name;
  EXPECT_EQ(code_of([&] { (void)engine.store().recording("none"); }), ErrorCode::not_found);
  EXPECT_EQ(code_of([&] { engine.store().put_model("../x", engine.store().model("soft-pzt")); }),
            ErrorCode::invalid_params);
}

TEST_F(EngineTest, ModelsPutAreKept) {
  auto model = engine.store().model("soft-pzt");
  EXPECT_EQ(code_of([&] { engine.store().put_model("soft-pzt", model); }), ErrorCode::busy);
  model["material"]["barrier"] = 3e4;
  engine.store().put_model("mine", model);
  EXPECT_EQ(engine.store().model("mine")["material"]["barrier"], 3e4);
  model["material"]["barier"] = 3e4;
  EXPECT_EQ(code_of([&] { engine.store().put_model("mine", model); }), ErrorCode::bad_model);
}

TEST_F(EngineTest, TheLeaseIsTheGate) {
  Dispatcher rpc;
  add_all_methods(rpc, engine);
  CallContext one{.client = "one", .lease = "", .subscriber = nullptr}, two = one;
  two.client = "two";
  const json limits = rpc.call("limits.get", nullptr, one);
  EXPECT_NO_THROW(rpc.call("limits.set", limits, two));  // nobody holds it
  const auto held = rpc.call("lease.acquire", {{"duration_s", 60}}, one);
  EXPECT_NO_THROW(rpc.call("limits.set", limits, one));
  EXPECT_EQ(code_of([&] { rpc.call("limits.set", limits, two); }), ErrorCode::not_controller);
  EXPECT_EQ(code_of([&] { rpc.call("lease.acquire", nullptr, two); }), ErrorCode::not_controller);
  EXPECT_NO_THROW(rpc.call("run.status", nullptr, two));
  EXPECT_EQ(rpc.call("lease.status", nullptr, two)["holder"], "one");
  EXPECT_EQ(rpc.call("lease.status", nullptr, two)["lease"], "");
  // Whoever shows the lease has it, on whatever connection.
  CallContext same{.client = "same", .lease = "", .subscriber = nullptr};
  EXPECT_EQ(code_of([&] {
              rpc.call("lease.present", {{"lease", "another"}}, same);
            }),
            ErrorCode::not_controller);
  EXPECT_EQ(code_of([&] { rpc.call("limits.set", limits, same); }), ErrorCode::not_controller);
  const auto shown = rpc.call("lease.present", {{"lease", held["lease"]}}, same);
  EXPECT_LE(shown["expires_in_s"], held["expires_in_s"]);
  EXPECT_EQ(shown["holder"], "one");
  EXPECT_NO_THROW(rpc.call("limits.set", limits, same));
  rpc.call("lease.renew", {{"lease", held["lease"]}}, two);
  EXPECT_NO_THROW(rpc.call("limits.set", limits, two));
  rpc.call("lease.release", nullptr, two);
  CallContext three{.client = "three", .lease = "", .subscriber = nullptr};
  EXPECT_NO_THROW(rpc.call("limits.set", limits, three));
}

TEST_F(EngineTest, EverybodyMayStopARun) {
  Dispatcher rpc;
  add_all_methods(rpc, engine);
  CallContext holder{.client = "holder", .lease = "", .subscriber = nullptr}, viewer = holder;
  viewer.client = "viewer";
  rpc.call("lease.acquire", nullptr, holder);
  rpc.call("run.start", write_json(request(trapezium(0.2, 30), false)), holder);
  await({RunState::running});
  EXPECT_EQ(code_of([&] { rpc.call("run.pause", nullptr, viewer); }), ErrorCode::not_controller);
  rpc.call("run.abort", {{"reason", "smoke"}}, viewer);
  const auto status = await({RunState::aborted});
  EXPECT_EQ(status.reason, "stopped by viewer: smoke");
  EXPECT_TRUE(status.output_at_zero);
  const auto r = recordings::read_recording(status.path);
  EXPECT_EQ(std::ranges::count(r.events, status.reason, &recordings::Event::message), 1);
}

TEST_F(EngineTest, ALostControllersRunIsStopped) {
  Dispatcher rpc;
  add_all_methods(rpc, engine);
  CallContext holder{.client = "holder", .lease = "", .subscriber = nullptr};
  const auto begin = [&](bool stop_run) {
    rpc.call("lease.acquire", {{"duration_s", 1}, {"stop_run", stop_run}}, holder);
    rpc.call("run.start", write_json(request(trapezium(0.2, 2), false)), holder);
    await({RunState::running});
  };
  begin(true);
  const auto lost = await({RunState::complete, RunState::aborted});
  EXPECT_EQ(lost.state, RunState::aborted);
  EXPECT_EQ(lost.reason, "lost its controller: the lease of holder ran out");
  EXPECT_TRUE(lost.output_at_zero);
  begin(true);
  rpc.call("lease.release", nullptr, holder);
  EXPECT_EQ(await({RunState::complete, RunState::aborted}).state, RunState::complete);
  begin(false);
  EXPECT_EQ(await({RunState::complete, RunState::aborted}).state, RunState::complete);
}

TEST_F(EngineTest, LimitsNotNamedStay) {
  Dispatcher rpc;
  add_all_methods(rpc, engine);
  CallContext caller{.client = "one", .lease = "", .subscriber = nullptr};
  rpc.call("limits.set", {{"force_max", 300}}, caller);
  const auto now = rpc.call("limits.set", {{"field_max", 1e6}, {"slew", nullptr}}, caller);
  EXPECT_EQ(now["force_max"], 300);
  EXPECT_EQ(now["field_max"], 1e6);
  EXPECT_EQ(now["slew"], daq::Limits{}.slew);
  const auto problems = problems_of([&] {
    rpc.call("limits.set", {{"force_max", "high"}, {"slow", 1}}, caller);
  });
  ASSERT_EQ(problems.size(), 2u);
  EXPECT_EQ(problems[0].path, "/force_max");
  EXPECT_EQ(rpc.call("limits.get", nullptr, caller), now);
}

TEST_F(EngineTest, DiscrepanciesAreSearchedForByJobs) {
  Dispatcher rpc;
  add_all_methods(rpc, engine);
  CallContext caller{.client = "one", .lease = "", .subscriber = nullptr};
  const auto call = [&](const std::string& method, const json& params) {
    return rpc.call(method, params, caller);
  };
  EXPECT_EQ(code_of([&] { call("discrepancy.start", {{"model", "soft-pzt"}}); }), ErrorCode::invalid_params);
  EXPECT_EQ(code_of([&] { call("discrepancy.start", {{"recordings", {"none"}}}); }), ErrorCode::not_found);
  EXPECT_EQ(code_of([&] { call("discrepancy.start", {{"tables", {"9.99"}}}); }), ErrorCode::not_found);
  const auto wait = [&](const std::string& job, auto&& until) {
    json status;
    for (int i = 0; i < 60000; ++i, usleep(5000)) {
      status = call("discrepancy.status", {{"job", job}});
      if (until(status)) return status;
    }
    ADD_FAILURE() << status.dump();
    return status;
  };

  const json crystal{{"model", "nec-single-crystal"}, {"tables", {"3.11"}}, {"name", "found"}};
  const std::string cancelled = call("discrepancy.start", crystal)["job"];
  wait(cancelled, [](const json& s) { return s["progress"].get<double>() > 0; });
  EXPECT_EQ(code_of([&] { call("discrepancy.result", {{"job", cancelled}}); }), ErrorCode::bad_state);
  call("job.cancel", {{"job", cancelled}});
  wait(cancelled, [](const json& s) { return s["state"] == "cancelled"; });
  EXPECT_EQ(code_of([&] { engine.store().model("found"); }), ErrorCode::not_found);

  const std::string job = call("discrepancy.start", crystal)["job"];
  const auto status = wait(job, [](const json& s) { return s["state"] != "running"; });
  ASSERT_EQ(status["state"], "complete") << status.dump();
  EXPECT_TRUE(status["result"].is_null());
  const json found = call("discrepancy.result", {{"job", job}});
  EXPECT_FALSE(found["explanations"].empty());
  EXPECT_EQ(engine.store().model("found"), found["model"]);
  const json page = call("discrepancy.result", {{"job", job}, {"format", "html"}});
  EXPECT_NE(page.get<std::string>().find("Table 3.11"), std::string::npos);
  const auto other = engine.jobs().start("fit", [](Jobs::Handle&) { return json{}; });
  EXPECT_EQ(code_of([&] { call("discrepancy.result", {{"job", other}}); }), ErrorCode::not_found);
}

TEST(Lease, RunsOut) {
  Lease lease;
  CallContext one{.client = "one", .lease = "", .subscriber = nullptr}, two = one;
  lease.acquire(one, 0.05);
  EXPECT_EQ(code_of([&] { lease.acquire(two, 1); }), ErrorCode::not_controller);
  usleep(80'000);
  EXPECT_EQ(lease.status().holder, "");
  EXPECT_NO_THROW(lease.acquire(two, 1));
  EXPECT_EQ(code_of([&] { lease.renew(one, "", 1); }), ErrorCode::not_controller);
}

TEST_F(EngineTest, JobsTellHowTheyEnded) {
  auto& jobs = engine.jobs();
  const auto await_end = [&](const std::string& id) {
    for (int i = 0; i < 1000 && jobs.status(id).state == JobState::running; ++i) usleep(2000);
    return jobs.status(id);
  };
  const auto good = jobs.start("simulate", [](Jobs::Handle& job) {
    job.say(0.5, "half");
    return json{{"answer", 42}};
  });
  EXPECT_EQ(await_end(good).result["answer"], 42);
  EXPECT_EQ(jobs.status(good).progress, 1);
  const auto bad =
      jobs.start("simulate", [](Jobs::Handle&) -> json { throw Error(ErrorCode::numerical, "it diverged"); });
  EXPECT_EQ(await_end(bad).state, JobState::failed);
  EXPECT_EQ(jobs.status(bad).error["name"], "numerical");
  const auto endless = jobs.start("fit", [](Jobs::Handle& job) -> json {
    for (;; usleep(1000)) job.check();
  });
  jobs.cancel(endless);
  EXPECT_EQ(await_end(endless).state, JobState::cancelled);
  EXPECT_EQ(code_of([&] { jobs.status("job-99"); }), ErrorCode::not_found);
  const auto stopped = jobs.start("fit", [](Jobs::Handle& job) {
    while (!job.cancelled()) usleep(1000);
    job.stopped();
    return json{{"best", 7}};
  });
  jobs.cancel(stopped);
  EXPECT_EQ(await_end(stopped).state, JobState::cancelled);
  EXPECT_EQ(jobs.status(stopped).result["best"], 7) << "what it had so far";
}

TEST_F(EngineTest, TablesAndFitsAreJobsThatCanBeStopped) {
  Dispatcher rpc;
  add_all_methods(rpc, engine);
  CallContext caller{.client = "one", .lease = "", .subscriber = nullptr};
  const auto call = [&](const std::string& method, const json& params) {
    return rpc.call(method, params, caller);
  };
  const auto ended = [&](const json& started) {
    for (int i = 0; i < 60000; ++i, usleep(5000))
      if (auto status = call("job.status", {{"job", started["job"]}}); status["state"] != "running")
        return status;
    return json();
  };
  EXPECT_EQ(code_of([&] { call("table.run", {{"table", "9.99"}}); }), ErrorCode::not_found);
  EXPECT_EQ(code_of([&] {
              call("table.run", {{"table", "3.13"}, {"format", "docx"}});
            }),
            ErrorCode::invalid_params);
  const json table{{"table", "3.13"}, {"model", "soft-pzt"}};
  const auto compared = ended(call("table.run", table));
  ASSERT_EQ(compared["state"], "complete") << compared.dump();
  EXPECT_EQ(compared["result"]["cells"].size(), 4u);
  auto as_text = table;
  as_text["format"] = "text";
  EXPECT_NE(ended(call("table.run", as_text))["result"]["content"].get<std::string>().find("3.13"),
            std::string::npos);

  const auto cut = call("table.run", table);
  call("job.cancel", {{"job", cut["job"]}});
  EXPECT_EQ(ended(cut)["state"], "cancelled");

  const auto fit = call("model.fit", {{"tables", {"3.13"}}, {"model", "soft-pzt"}, {"name", "kept"}});
  const auto at_work = [&] {  // its first simulation is over, so that there is a best so far
    return call("job.status", {{"job", fit["job"]}})["stage"].get<std::string>().starts_with("searching");
  };
  for (int i = 0; i < 60000 && !at_work(); ++i) usleep(5000);
  call("job.cancel", {{"job", fit["job"]}});
  const auto best = ended(fit);
  EXPECT_EQ(best["state"], "cancelled");
  EXPECT_TRUE(best["result"]["stopped"].get<bool>()) << best.dump();
  EXPECT_EQ(code_of([&] { engine.store().model("kept"); }), ErrorCode::not_found);

  const auto jobs = call("job.list", nullptr)["jobs"];
  EXPECT_EQ(jobs.size(), 4u);
  EXPECT_EQ(jobs[0]["kind"], "fit") << "newest first";
  EXPECT_TRUE(jobs[3]["result"].is_null()) << "a list holds no results";
}

TEST(Live, MergingKeepsExtremesAndStaysSmall) {
  std::vector<double> time(5000), field(5000);
  for (std::size_t i = 0; i < time.size(); ++i) {
    time[i] = static_cast<double>(i);
    field[i] = std::sin(0.01 * static_cast<double>(i));
  }
  field[1234] = 7;
  field[2345] = NAN;
  json held;
  for (std::size_t first = 0; first < time.size(); first += 100) {
    recordings::Rows rows{.time = std::span(time).subspan(first, 100), .channels = {}, .counts = {}};
    rows.channels[static_cast<std::size_t>(Channel::field)] = std::span(field).subspan(first, 100);
    json next{{"run", "r"},
              {"measured", std::to_string(first)},
              {"columns", decimate(rows, recordings::stretches(rows.time, 20))}};
    if (held.is_null()) {
      held = next;
    } else {
      merge_samples(held, next);
    }
  }
  const auto& columns = held["columns"];
  EXPECT_LE(columns["time"].size(), max_bins);
  EXPECT_GE(columns["time"].size(), max_bins / 4);
  EXPECT_EQ(columns["field"]["max"].size(), columns["time"].size());
  double high = -9;
  for (const auto& v : columns["field"]["max"]) high = std::max(high, v.get<double>());
  EXPECT_EQ(high, 7);
  EXPECT_EQ(columns["time"][0], 0);
  EXPECT_EQ(columns["field"]["first"][0], 0);
  EXPECT_EQ(held["measured"], "4900") << "that of the newest";
}

// What is drawn of {time, field: {min, max}}: a band from stretch to stretch. It may be wide within `beside`
// of a ramp alone.
void expect_level_holds(const json& columns, const recordings::testing::UnevenRows& rows, double beside) {
  const auto at = [&](std::size_t k) { return columns["time"][k].get<double>(); };
  for (std::size_t k = 0; k + 1 < columns["time"].size(); ++k)
    for (double t = at(k); t < at(k + 1); t += beside / 4) {
      const double share = (t - at(k)) / (at(k + 1) - at(k));
      const double level = rows.level_at(t, beside);
      for (const auto* part : {"min", "max"}) {
        const auto& edge = columns["field"][part];
        const double drawn = std::lerp(edge[k].get<double>(), edge[k + 1].get<double>(), share);
        ASSERT_TRUE(std::isnan(level) || std::abs(drawn - level) < 1e-9) << drawn << " at " << t << " s";
      }
    }
}

TEST(Live, RowsUnevenlySpacedAreDrawnWhereTheyAre) {
  const recordings::testing::UnevenRows all;
  const auto rows_at = [&](std::size_t first, std::size_t count) {
    count = std::min(count, all.time.size() - first);
    recordings::Rows rows{.time = std::span(all.time).subspan(first, count), .channels = {}, .counts = {}};
    rows.channels[static_cast<std::size_t>(Channel::field)] = std::span(all.field).subspan(first, count);
    return rows;
  };
  const double duration = all.time.back();
  const auto thinned = [](const recordings::Rows& rows, std::size_t most) {
    return decimate(rows, recordings::stretches(rows.time, most));
  };
  const auto whole = thinned(rows_at(0, all.time.size()), 2000);
  EXPECT_LE(whole["time"].size(), 2000u);
  expect_level_holds(whole, all, 2 * duration / 1000);
  json held;
  for (std::size_t first = 0; first < all.time.size(); first += 50) {
    json next{{"run", "r"}, {"measured", ""}, {"columns", thinned(rows_at(first, 50), max_bins)}};
    if (held.is_null()) {
      held = next;
    } else {
      merge_samples(held, next);
    }
  }
  EXPECT_LE(held["columns"]["time"].size(), max_bins);
  expect_level_holds(held["columns"], all, 4 * duration / max_bins);
}

TEST(Live, BlocksFasterThanThePaceAreShownAtIt) {
  using std::chrono::milliseconds;
  Pace pace(milliseconds(33));
  const Pace::Clock::time_point begin{std::chrono::hours(1)};
  int shown = 0;
  for (int block = 0; block < 500; ++block) shown += pace.passes(begin + milliseconds(20 * block)) ? 1 : 0;
  EXPECT_NEAR(shown, 10'000 / 33, 1);
  EXPECT_TRUE(pace.passes(begin + milliseconds(20'000))) << "a silence";
  EXPECT_FALSE(pace.passes(begin + milliseconds(20'001))) << "gives no right to a burst";
  EXPECT_TRUE(Pace().passes(begin));
}

// Begun by the server, measured by the bench, followed and made into a file by the server.
TEST(Recorder, LostRowsAreNotANumber) {
  const Folder folder;
  recordings::Header header;
  header.specimen = {"s", 0.01, 1e-4, 1e-4, 10};
  const auto path = (folder.path / "gap.h5").string();
  const daq::Scaling scaling({{Channel::field, 2.0, 1.0}}, {}, 10);
  const recordings::Begin begin{header,
                                {scaling.channels().begin(), scaling.channels().end()},
                                {scaling.columns().begin(), scaling.columns().end()}};
  recordings::BegunRecording file(path, begin, recordings::Existing::keep);
  recordings::JournalFollower follower(file.journal(), begin);
  std::vector<recordings::Event> told;
  bench::Recorder recorder(file.journal(), recordings::journal_path(path), scaling,
                           [&](const recordings::Event& event) { told.push_back(event); });
  daq::SampleBlock block;
  block.rows = 2;
  block.counts = {1, 2};
  block.command = {0, 1};
  recorder.take(block);
  block.first_sample = 5;
  block.events = {{0.2, "gap", "3 rows were lost"}};
  recorder.take(block);
  EXPECT_EQ(told.size(), 1u);
  std::vector<double> followed;
  follower.next(1u << 20, [&](const recordings::Columns& rows) {
    followed.insert(followed.end(), rows.time.begin(), rows.time.end());
  });
  EXPECT_EQ(followed.size(), 7u);
  follower.next(1u << 20, [](const recordings::Columns&) { ADD_FAILURE() << "the same rows again"; });
  EXPECT_EQ(recordings::journal_state(path), recordings::JournalState::being_written);
  recordings::Ending ending{.end_time = {}, .status = "complete", .reason = {}, .segments = {}, .noise = {}};
  recorder.finish(ending, "2026-01-01T00:00:00Z");
  EXPECT_EQ(recorder.rows_kept(), 7u);
  file.finish(ending, recorder.rows_kept());
  EXPECT_EQ(recordings::journal_state(path), recordings::JournalState::none);
  const auto r = recordings::read_recording(path);
  ASSERT_EQ(r.size(), 7u);
  const auto& field = r.at(Channel::field);
  EXPECT_EQ(field[1], 5);
  for (const std::size_t lost : {2, 3, 4}) EXPECT_TRUE(std::isnan(field[lost]));
  EXPECT_EQ(field[6], 5);
  EXPECT_DOUBLE_EQ(r.time[6], 0.6);
  ASSERT_EQ(r.events.size(), 1u);
}

}  // namespace
}  // namespace ferrobench::server

// What a page asks for: curves true to the samples, protocols of one's own, published values beside a
// recording.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <algorithm>
#include <cmath>
#include <fstream>

#include "engine_bench.h"
#include "recordings/file/reader.h"
#include "server/methods/methods.h"

namespace ferrobench::server {
namespace {

using nlohmann::json;
using recordings::Channel;

class Views : public EngineTest {
 protected:
  Views() { add_all_methods(rpc, engine); }
  json call(const std::string& name, const json& params) { return rpc.call(name, params, caller); }
  Error refusal(const std::string& name, const json& params) {
    try {
      call(name, params);
    } catch (const Error& error) {
      return error;
    }
    return {ErrorCode::internal, "was not refused"};
  }
  std::string recorded(const json& request) {
    call("run.start", request);
    return engine.wait(engine.status().run).recording;
  }

  Dispatcher rpc;
  CallContext caller{.client = "test", .lease = "", .subscriber = nullptr};
};

const json sweep{{"format", "ferrobench-protocol"},
                 {"version", 1},
                 {"name", "sweep"},
                 {"unit", "kV/mm"},
                 {"sample_rate_Hz", 2000},
                 {"start", 0},
                 {"segments",
                  {{{"kind", "sine"}, {"amplitude", 0.5}, {"frequency", 1}, {"cycles", 1.25}},
                   {{"kind", "sine"}, {"amplitude", 0.5}, {"frequency", 20}, {"cycles", 3}, {"phase", 90}}}}};

double apart(double px, double py, double ax, double ay, double bx, double by) {
  const double length2 = (bx - ax) * (bx - ax) + (by - ay) * (by - ay);
  const double t =
      length2 > 0 ? std::clamp(((px - ax) * (bx - ax) + (py - ay) * (by - ay)) / length2, 0., 1.) : 0;
  return std::hypot(px - ax - t * (bx - ax), py - ay - t * (by - ay));
}

TEST_F(Views, CurvesOfASweepAreTrueToTheSamples) {
  const auto name = recorded({{"protocol", sweep}, {"fast", true}});
  const auto read =
      call("recording.read", {{"name", name}, {"axes", {"field", "displacement"}}, {"pixels", 200}});
  EXPECT_DOUBLE_EQ(read["chord_error"].get<double>(), 0.5 / 200);
  EXPECT_GE(read["cycles"], 3);
  const auto r = recordings::read_recording(engine.store().recording(name).string());
  const auto &field = r.at(Channel::field), &x = r.at(Channel::displacement);
  const auto [low, high] = std::ranges::minmax(field);
  const auto [short_end, long_end] = std::ranges::minmax(x);
  // Every sample lies as near to some piece of a curve.
  double worst = 0;
  for (std::size_t i = 0; i < r.size(); ++i) {
    double nearest = INFINITY;
    for (const auto& curve : read["curves"])
      for (std::size_t k = 0; k + 1 < curve["x"].size(); ++k)
        nearest = std::min(nearest, apart(field[i] / (high - low), x[i] / (long_end - short_end),
                                          curve["x"][k].get<double>() / (high - low),
                                          curve["y"][k].get<double>() / (long_end - short_end),
                                          curve["x"][k + 1].get<double>() / (high - low),
                                          curve["y"][k + 1].get<double>() / (long_end - short_end)));
    worst = std::max(worst, nearest);
  }
  EXPECT_LE(worst, 0.5 / 200 * 1.001);
}

// From the first sample of a hold on, however long it is.
TEST_F(Views, CreepIsDrawnFromTheStartOfEachHold) {
  auto program = trapezium(0.1, 20);
  program["segments"][0]["to"] = -0.5;
  program["start"] = 0.5;
  const auto name = recorded({{"protocol", program}, {"fast", true}});
  const auto read = call("recording.read", {{"name", name}, {"axes", {"time_in_hold", "displacement"}}});
  ASSERT_EQ(read["curves"].size(), 1u);
  const auto& curve = read["curves"][0];
  EXPECT_EQ(curve["label"], "the hold");
  EXPECT_EQ(curve["level"], -0.5e6);
  const auto r = recordings::read_recording(engine.store().recording(name).string());
  const auto first = static_cast<std::size_t>(r.segments[1].start_sample);
  const auto& x = r.at(Channel::displacement);
  EXPECT_NEAR(curve["x"][0].get<double>(), 1.0 / 200, 1e-9);
  EXPECT_GT(curve["x"].size(), 60u);
  EXPECT_LT(curve["x"].size(), 200u);
  const auto [low, high] = std::ranges::minmax(x);
  for (std::size_t k = 0; k < curve["x"].size(); ++k) {
    const auto at = first + static_cast<std::size_t>(std::lround(curve["x"][k].get<double>() * 200));
    EXPECT_NEAR(curve["y"][k].get<double>(), x[at] - x[first], 0.01 * (high - low)) << k;
  }
  EXPECT_EQ(
      refusal("recording.read", {{"name", name}, {"axes", {"time_in_hold", "time"}}}).problems().at(0).path,
      "/axes/1");
}

TEST_F(Views, AxesThatAreNotThereAreRefused) {
  const auto name = recorded({{"protocol", sweep}, {"fast", true}});
  const auto error = refusal("recording.read", {{"name", name}, {"axes", {"field", "warmth"}}});
  EXPECT_EQ(error.code(), ErrorCode::invalid_params);
  EXPECT_EQ(error.problems().at(0).path, "/axes/1");
  EXPECT_THAT(error.problems().at(0).allowed.dump(), testing::HasSubstr("displacement"));
  EXPECT_EQ(refusal("recording.read", {{"name", name}, {"axes", {"field"}}}).problems().at(0).path, "/axes");
}

TEST_F(Views, AProtocolOfOnesOwnIsKeptListedAndRun) {
  call("protocol.put", {{"name", "my-sweep"}, {"protocol", sweep}});
  EXPECT_EQ(call("protocol.get", {{"name", "my-sweep"}})["protocol"]["name"], "my-sweep");
  const auto list = call("protocol.list", json::object())["protocols"];
  const auto mine = std::ranges::find_if(list, [](const json& p) { return p["name"] == "my-sweep"; });
  ASSERT_NE(mine, list.end());
  EXPECT_FALSE((*mine)["shipped"].get<bool>());
  const auto name = recorded({{"protocol", "my-sweep"}, {"fast", true}});
  EXPECT_EQ(call("recording.info", {{"name", name}})["protocol"]["name"], "my-sweep");

  EXPECT_EQ(refusal("protocol.put", {{"name", "full-loops"}, {"protocol", sweep}}).code(), ErrorCode::busy);
  EXPECT_EQ(refusal("protocol.put", {{"name", "../x"}, {"protocol", sweep}}).code(),
            ErrorCode::invalid_params);
  auto wrong = sweep;
  wrong["segments"][0]["amplitude"] = "high";
  EXPECT_EQ(refusal("protocol.put", {{"name", "wrong"}, {"protocol", wrong}}).code(),
            ErrorCode::bad_protocol);
  EXPECT_EQ(refusal("protocol.get", {{"name", "my-sweeb"}}).code(), ErrorCode::not_found);
}

// A file that somebody left there, and a pipe that nobody writes to, spoil no list.
TEST_F(Views, AProtocolsFileThatCannotBeUsedIsListedWithItsReason) {
  const auto protocols = engine.store().folder() / "protocols";
  std::ofstream(protocols / "torn.json") << "{\"format\": ";
  ASSERT_EQ(mkfifo((protocols / "pipe.json").c_str(), 0600), 0);
  const auto list = call("protocol.list", json::object())["protocols"];
  for (const auto& name : {"torn", "pipe"}) {
    const auto row = std::ranges::find_if(list, [&](const json& p) { return p["name"] == name; });
    ASSERT_NE(row, list.end()) << name;
    EXPECT_NE((*row)["error"], "") << name;
  }
  EXPECT_EQ(std::ranges::count_if(list, [](const json& p) { return p["error"] != ""; }), 2);
}

TEST_F(Views, AReportSaysItsOrder) {
  const auto name = recorded({{"protocol", sweep}, {"fast", true}});
  const auto report = call("recording.report", {{"name", name}});
  ASSERT_GE(report["order"]["tables"].size(), 2u);
  for (const auto& key : report["order"]["tables"]) {
    const auto& table = report[key.get<std::string>()];
    for (const auto& row : table["rows"])
      for (const auto& column : table["columns"]) EXPECT_TRUE(row.contains(column["key"].get<std::string>()));
  }
  EXPECT_EQ(report["order"]["facts"].at(0), "status");
}

TEST_F(Views, PublishedValuesStandBesideARecording) {
  const auto name =
      recorded({{"protocol", "creep-6-holds-fast"}, {"fast", true}, {"set", {{"prestress_MPa", 8}}}});
  const auto table = call("table.compare", {{"table", "3.11"}, {"recordings", {name}}});
  std::size_t measured = 0;
  for (const auto& row : table["rows"]) measured += row["measured"].is_null() ? 0 : 1;
  EXPECT_EQ(measured, 6u) << "of the one prestress";
  EXPECT_EQ(refusal("table.compare", {{"table", "9.9"}, {"recordings", {name}}}).code(),
            ErrorCode::not_found);
  const auto tables = call("table.list", json::object())["tables"];
  ASSERT_EQ(tables.size(), 4u);
  EXPECT_EQ(tables[1]["name"], "3.11");
  EXPECT_EQ(tables[1]["title"], table["title"]);
}

// What a search names stands there with its equation, units and plausible sizes; a model may have it.
TEST_F(Views, EffectsAreListed) {
  const auto effects = call("model.effects", json::object())["effects"];
  const auto lag = std::ranges::find_if(effects, [](const json& e) { return e["id"] == "displacement_lag"; });
  ASSERT_NE(lag, effects.end());
  EXPECT_EQ((*lag)["equation"], "xm = lag(x)");
  EXPECT_EQ((*lag)["family"], "displacement sensor");
  const auto& parameter = (*lag)["parameters"].at(0);
  EXPECT_EQ(parameter["name"], "time_constant");
  EXPECT_EQ(parameter["unit"], "s");
  auto model = call("model.get", {{"name", "nec-single-crystal"}})["model"];
  model["effects"] = {{{"id", (*lag)["id"]}, {"parameters", {{"time_constant", parameter["low"]}}}}};
  EXPECT_NO_THROW(call("model.put", {{"name", "lagging"}, {"model", model}}));
}

}  // namespace
}  // namespace ferrobench::server

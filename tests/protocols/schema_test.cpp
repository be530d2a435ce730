// The published schema and validate() agree, as far as a schema can say it.
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>

#include "tests/protocols/programs.h"

namespace ferrobench::protocols {
namespace {

using nlohmann::json;

json one(json segment) {
  return program(json::array({std::move(segment)}));
}

std::vector<json> documents() {
  std::vector<json> out;
  for (const auto& name : library_names()) out.push_back(library_protocol(name).json());
  const json hold = {{"kind", "hold"}, {"time", 1}};
  const std::vector<json> segments = {
      hold,
      {{"kind", "hold"}, {"time", 1}, {"sample_rate_Hz", 10}, {"readings_per_decade", 20}},
      {{"kind", "ramp"}, {"to", 1}, {"time", 1}, {"label", "up"}},
      {{"kind", "ramp"}, {"to", 1}, {"time", 1}, {"readings_per_decade", 20}},
      {{"kind", "reversals"}, {"count", 3}, {"first", 1}, {"last", 0}, {"rate", 1}, {"hold", 1}},
      {{"kind", "reversals"},
       {"order", 2},
       {"points", {1, 2}},
       {"rate", 1},
       {"back_to", 0},
       {"hold_back", 1}},
      {{"kind", "reversals"},
       {"order", 3},
       {"points", {1}},
       {"rate", 1},
       {"back_to", 3},
       {"rise", 1},
       {"through", 0}},
      {{"kind", "triangle"}, {"low", 0}, {"high", 1}, {"frequency", 1}, {"cycles", 2}, {"first", "down"}},
      {{"kind", "sine"}, {"amplitude", 1}, {"frequency", 1}, {"cycles", 1.5}, {"phase", 90}},
      {{"kind", "pund"}, {"amplitude", -1}, {"width", 1}, {"delay", 1}, {"rise", 1}},
      {{"kind", "small_signal"},
       {"levels", {1, -1}},
       {"rate", 1},
       {"settle", 1},
       {"amplitude", 0.1},
       {"frequency", 10},
       {"cycles", 5}},
      {{"kind", "points"}, {"points", {{0, 1}, {1, 2}}}},
      {{"kind", "points"}, {"csv", "0,1\n1,2\n"}},
      {{"kind", "repeat"}, {"count", 2}, {"segments", json::array({hold})}},
      {{"kind", "repeat"}, {"count", 3}, {"average", true}, {"segments", json::array({hold})}},
      {{"kind", "repeat"}, {"count", 2}, {"average", true}, {"segments", json::array({hold})}},
      {{"kind", "repeat"}, {"count", 2}, {"average", false}, {"segments", json::array({hold})}}};
  for (const auto& segment : segments) {
    out.push_back(one(segment));
    for (const auto& [key, value] : segment.items()) {
      auto less = segment;
      less.erase(key);
      out.push_back(one(less));
      for (const auto& other :
           {json(nullptr), json("$x"), json(true), json(-2e9), json::object(), json::array()}) {
        auto changed = segment;
        changed[key] = other;
        out.push_back(one(changed));
        out.back()["parameters"] = {{"x", 1}};
      }
    }
    for (const auto* key : {"rate", "time", "points", "order", "rise", "hold_back", "unknown"}) {
      auto more = segment;
      more[key] = 1;
      out.push_back(one(more));
    }
  }
  const json level = {{"field_V_per_m", -1e6}, {"seconds", 1}};
  for (const json& past : std::initializer_list<json>{
           {{"kind", "poled_minus"}},
           {{"kind", "cycled"}, {"from", "unpoled"}},
           {{"kind", "partly_poled"}},
           {{"kind", "partly_poled"}, {"poling", -0.4}},
           {{"kind", "partly_poled"}, {"poling", -1.4}},
           {{"kind", "unpoled"}, {"poling", 0.4}},
           {{"kind", "cycled"}, {"from", "partly_poled"}},
           {{"kind", "cycled"}, {"from", "partly_poled"}, {"poling", 0.4}},
           {{"kind", "visited"}},
           {{"kind", "visited"}, {"levels", json::array()}},
           {{"kind", "visited"}, {"levels", json::array({level})}},
           {{"kind", "visited"}, {"from", "unpoled"}, {"levels", json::array({level, level})}},
           {{"kind", "visited"}, {"from", "cycled"}, {"levels", json::array({level})}},
           {{"kind", "unpoled"}, {"levels", json::array({level})}},
           {{"kind", "visited"}, {"levels", json::array({{{"field_V_per_m", 2e9}, {"seconds", 1}}})}},
           {{"kind", "visited"}, {"levels", json::array({{{"field_V_per_m", 0}, {"seconds", 0}}})}},
           {{"kind", "poled"}},
           json::object(),
           json("poled_minus")}) {
    out.push_back(one(hold));
    out.back()["past"] = past;
  }
  const auto whole = one(hold);
  out.push_back(whole);
  out.back()["$schema"] = "https://example.org/protocol.schema.json";
  out.push_back(whole);
  out.back()["$schema"] = 5;
  for (const auto* key : {"format", "version", "name", "unit", "segments"}) {
    auto less = whole;
    less.erase(key);
    out.push_back(less);
  }
  for (const auto* key : {"version", "name", "title", "unit", "layer_thickness_m", "sample_rate_Hz", "load",
                          "parameters", "start", "segments", "other"}) {
    for (const auto& value :
         {json(0), json(1), json("V"), json(""), json(nullptr), json({{"prestress_Pa", 1}})}) {
      auto changed = whole;
      changed[key] = value;
      out.push_back(changed);
    }
  }
  return out;
}

// A schema cannot weigh one number against another, read CSV, or look up the value of a parameter.
bool beyond_a_schema(const Problem& problem) {
  for (const auto* message : {"must be below high", "is not a time and a level", "never moves nor waits",
                              "has no point", "has a level outside its range"})
    if (problem.message.find(message) != std::string::npos) return true;
  return false;
}

// By a validator that is not ours.
void check_with_schema(const json& cases) {
  const auto* test = testing::UnitTest::GetInstance()->current_test_info()->name();
  const auto path =
      testing::TempDir() + "protocol_schema_cases_" + std::to_string(getpid()) + "_" + test + ".json";
  std::ofstream(path) << json{{"schema", protocol_schema()}, {"cases", cases}};
  const std::string command =
      std::string(FERROBENCH_PYTHON) + " " + FERROBENCH_SCHEMA_CHECK + " '" + path + "'";
  EXPECT_EQ(std::system(command.c_str()), 0) << "needs python3-jsonschema; " << command;
  std::filesystem::remove(path);
}

TEST(Schema, AgreesWithValidate) {
  json cases = json::array();
  int good = 0, bad = 0;
  for (const auto& document : documents()) {
    const auto problems = validate(document);
    const bool uses_parameter = document.dump().find("\"$x\"") != std::string::npos;
    const bool unclear = !problems.empty() &&
                         (uses_parameter || std::all_of(problems.begin(), problems.end(), beyond_a_schema));
    if (unclear) continue;
    cases.push_back({{"name", "case " + std::to_string(cases.size())},
                     {"document", document},
                     {"valid", problems.empty()}});
    ++(problems.empty() ? good : bad);
  }
  EXPECT_GT(good, 40);
  EXPECT_GT(bad, 200);
  check_with_schema(cases);
}

// In a name, in a kind, in a value; at the top, in a segment, in a nested one: the schema and validate() both
// tell of it once, and validate() names the place in the document as it was given.
TEST(Schema, OneTypoIsOneProblem) {
  const json hold = {{"kind", "hold"}, {"time", 1}};
  const auto nested = [](json inner) {
    return one({{"kind", "repeat"}, {"count", 2}, {"segments", json::array({std::move(inner)})}});
  };
  auto top = one(hold);
  top["segmens"] = top["segments"];
  top.erase("segments");
  auto load = one(hold);
  load["load"] = {{"prestress", 1}};
  const std::vector<std::pair<json, std::string>> typos = {
      {one({{"kind", "hold"}, {"tyme", 1}}), "/segments/0/tyme"},
      {one({{"kind", "hodl"}, {"time", 1}}), "/segments/0/kind"},
      {one({{"kind", "hold"}, {"time", "1"}}), "/segments/0/time"},
      {one({{"kind", "ramp"}, {"to", 1}, {"rat", 1}}), "/segments/0/rat"},
      {one({{"kind", "reversals"}, {"pionts", {1}}, {"rate", 1}}), "/segments/0/pionts"},
      {nested({{"kind", "hold"}, {"tim", 1}}), "/segments/0/segments/0/tim"},
      {top, "/segmens"},
      {load, "/load/prestress"}};
  json cases = json::array();
  for (const auto& [document, place] : typos) {
    const auto problems = validate(document);
    ASSERT_EQ(problems.size(), 1u) << document
                                   << (problems.size() > 1 ? problems[1].path + problems[1].message : "");
    EXPECT_EQ(problems[0].path, place);
    cases.push_back({{"name", place}, {"document", document}, {"valid", false}, {"problems", 1}});
  }
  check_with_schema(cases);
}

TEST(Schema, NamesEveryKindWithItsUnits) {
  const auto schema = protocol_schema();
  std::vector<std::string> kinds;
  for (const auto& kind : schema["$defs"]["segment"]["properties"]["kind"]["enum"]) {
    kinds.push_back(kind);
    EXPECT_EQ(schema["$defs"][kinds.back()]["title"], kind);
  }
  EXPECT_EQ(kinds, (std::vector<std::string>{"ramp", "hold", "repeat", "reversals", "triangle", "sine",
                                             "pund", "small_signal", "points"}));
  EXPECT_EQ(schema["$defs"]["ramp"]["properties"]["rate"]["x-unit"], "kV/mm/s or V/s");
}

}  // namespace
}  // namespace ferrobench::protocols

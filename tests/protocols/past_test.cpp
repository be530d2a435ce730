// A specimen's past as JSON: what it may say, and what is told of what it may not.
#include "protocols/past.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "protocols/protocol.h"

namespace ferrobench::protocols {
namespace {

using nlohmann::json;
using ::testing::HasSubstr;

json visited() {
  return json::parse(
      R"({"kind": "visited", "from": "unpoled", "levels": [{"field_V_per_m": -1.5e6, "seconds": 2}]})");
}

TEST(PastJson, ComesBackAsItWas) {
  const auto past = past_from_json(visited(), ErrorCode::invalid_params);
  EXPECT_EQ(past, (Past{PastKind::visited, FirstState::unpoled, {{-1.5e6, 2}}}));
  EXPECT_EQ(to_json(past), visited());
  for (const auto& [kind, name] : enum_names(PastKind{})) {
    if (kind == PastKind::visited || kind == PastKind::partly_poled) continue;
    EXPECT_EQ(past_from_text(std::string(name)).kind, kind);
    EXPECT_EQ(to_json(Past{kind}), (json{{"kind", name}}));
  }
  EXPECT_EQ(past_from_text(visited().dump()), past);
  for (const auto* text : {R"({"kind":"partly_poled","poling":-0.4})",
                           R"({"from":"partly_poled","kind":"cycled","poling":1.0})"}) {
    EXPECT_EQ(to_json(past_from_text(text)), json::parse(text));
    EXPECT_THAT(in_words(past_from_text(text)), HasSubstr("poled to "));
  }
}

// The place and the words of the first problem.
std::pair<std::string, std::string> problem_of(const json& given) {
  try {
    past_from_json(given, ErrorCode::invalid_params);
  } catch (const Error& e) {
    if (e.problems().empty()) return {};
    return {e.problems()[0].path, e.problems()[0].message};
  }
  return {"none", ""};
}

TEST(PastJson, IsRefusedWithItsPlace) {
  EXPECT_EQ(problem_of({{"kind", "poled"}}).first, "/past/kind");
  EXPECT_EQ(problem_of(json::object()).first, "/past/kind");
  EXPECT_EQ(problem_of({{"kind", "visited"}}).first, "/past/levels");
  EXPECT_EQ(problem_of({{"kind", "unpoled"}, {"from", "unpoled"}}).first, "/past/from");
  EXPECT_EQ(problem_of({{"kind", "partly_poled"}}).first, "/past/poling");
  EXPECT_EQ(problem_of({{"kind", "partly_poled"}, {"poling", 1.1}}).first, "/past/poling");
  EXPECT_EQ(problem_of({{"kind", "cycled"}, {"from", "partly_poled"}}).first, "/past/poling");
  EXPECT_EQ(problem_of({{"kind", "unpoled"}, {"poling", 0}}).first, "/past/poling");
  auto given = visited();
  given["kind"] = "cycled";
  EXPECT_EQ(problem_of(given).first, "/past/levels");
  for (const auto& [field, seconds] :
       std::vector<std::pair<json, json>>{{1e10, 1}, {0, 0}, {0, -1}, {0, 1e10}}) {
    given = visited();
    given["levels"][0] = {{"field_V_per_m", field}, {"seconds", seconds}};
    EXPECT_THAT(problem_of(given).first, HasSubstr("/past/levels/0/")) << given;
  }
  given = visited();
  given["levels"] = std::vector<json>(most_visited_levels + 1, given["levels"][0]);
  EXPECT_EQ(problem_of(given).second, "has too many levels");
}

TEST(PastJson, BelongsToAProtocol) {
  auto given = json::parse(
      R"({"format": "ferrobench-protocol", "version": 1, "name": "p", "unit": "kV/mm",
          "segments": [{"kind": "hold", "time": 1}]})");
  EXPECT_FALSE(Protocol::from_json(given).past());
  given["past"] = visited();
  EXPECT_EQ(Protocol::from_json(given).past()->levels.size(), 1U);
  given["past"]["kind"] = "unpoled";
  const auto problems = validate(given);
  ASSERT_FALSE(problems.empty());
  EXPECT_EQ(problems[0].path, "/past/levels");
}

TEST(PastLevels, AreAddedAndTakenAway) {
  const VisitedLevel level{1e6, 1};
  for (const auto kind : {PastKind::poled_plus, PastKind::poled_minus, PastKind::unpoled}) {
    const auto on = and_then({kind}, {&level, 1});
    EXPECT_EQ(on.kind, PastKind::visited);
    EXPECT_EQ(on.levels, std::vector{level});
    EXPECT_EQ(without_last_level(on), Past{kind});
  }
  const Past there{PastKind::visited, FirstState::unpoled, {{-1.5e6, 2}}};
  EXPECT_EQ(without_last_level(and_then(there, {&level, 1})), there);
  EXPECT_EQ(and_then(there, {}), there);
  EXPECT_FALSE(and_then({PastKind::cycled}, {&level, 1}).known());
  EXPECT_FALSE(and_then(there, std::vector(most_visited_levels, level)).known());
}

TEST(PastInWords, SaysFromWhichStateItBegan) {
  EXPECT_EQ(in_words({PastKind::poled_minus}), "poled towards -");
  EXPECT_EQ(in_words({PastKind::cycled, FirstState::unpoled}),
            "unpoled, then cycled through the program until it repeated itself");
  EXPECT_EQ(in_words({PastKind::visited, std::nullopt, {{-1.75e6, 1}, {0, 1}}}),
            "poled towards +, then taken to -1.75 kV/mm");
  EXPECT_EQ(in_words({PastKind::visited, FirstState::unpoled, {{1.5e6, 1}, {-1.75e6, 1}, {0, 1}}}),
            "unpoled, then taken through 3 levels, the farthest of them -1.75 kV/mm");
}

}  // namespace
}  // namespace ferrobench::protocols

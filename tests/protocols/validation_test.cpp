// Every problem of a protocol is found at once, each with the place where it is.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/protocols/programs.h"

namespace ferrobench::protocols {
namespace {

using nlohmann::json;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::UnorderedElementsAre;

std::vector<std::string> paths(const json& given) {
  std::vector<std::string> out;
  for (const auto& problem : validate(given)) out.push_back(problem.path);
  return out;
}

std::vector<std::string> segment_paths(json segment) {
  return paths(program(json::array({std::move(segment)})));
}

const json hold = {{"kind", "hold"}, {"time", 1}};

TEST(Validation, PassesWhatIsRight) {
  EXPECT_THAT(segment_paths(hold), IsEmpty());
}

TEST(Validation, FindsWhatIsMissingOrUnknownAtTheTop) {
  EXPECT_THAT(paths(json::object()),
              UnorderedElementsAre("/format", "/version", "/name", "/unit", "/segments"));
  EXPECT_THAT(paths(json::array()), ElementsAre(""));
  auto given = program(json::array({hold}));
  given["sampel_rate_Hz"] = 50;
  given["version"] = 2;
  given["unit"] = "MV/m";
  given["name"] = "../../etc/passwd";
  given["start"] = "up";
  given["load"] = {{"prestress_MPa", 4}};
  EXPECT_THAT(paths(given), UnorderedElementsAre("/sampel_rate_Hz", "/version", "/unit", "/name", "/start",
                                                 "/load/prestress_MPa"));
  const auto problems = validate(given);
  const auto typo = std::find_if(problems.begin(), problems.end(),
                                 [](const Problem& p) { return p.path == "/sampel_rate_Hz"; });
  EXPECT_EQ(typo->hint, "did you mean \"sample_rate_Hz\"?");
}

TEST(Validation, FindsProblemsOfManySegmentsAtOnce) {
  const json segments = {{{"kind", "rmap"}, {"to", 1}, {"rate", 1}},
                         {{"to", 1}},
                         {{"kind", "hold"}, {"time", -1}, {"lable", "x"}},
                         {{"kind", "ramp"}, {"to", "high"}, {"rate", 1}},
                         "hold",
                         {{"kind", "repeat"}, {"count", 0}, {"segments", {hold, {{"kind", "hold"}}}}}};
  EXPECT_THAT(paths(program(segments)),
              UnorderedElementsAre("/segments/0/kind", "/segments/1/kind", "/segments/2/time",
                                   "/segments/2/lable", "/segments/3/to", "/segments/4", "/segments/5/count",
                                   "/segments/5/segments/1/time"));
  EXPECT_EQ(validate(program(segments)).front().hint, "did you mean \"ramp\"?");
}

TEST(Validation, WantsExactlyOneOfTwo) {
  EXPECT_THAT(segment_paths({{"kind", "ramp"}, {"to", 1}}), ElementsAre("/segments/0"));
  EXPECT_THAT(segment_paths({{"kind", "ramp"}, {"to", 1}, {"rate", 1}, {"time", 1}}),
              ElementsAre("/segments/0"));
  EXPECT_THAT(segment_paths({{"kind", "triangle"}, {"low", 0}, {"high", 1}}), ElementsAre("/segments/0"));
  EXPECT_THAT(segment_paths({{"kind", "pund"}, {"amplitude", 1}, {"width", 1}, {"delay", 1}}),
              ElementsAre("/segments/0"));
  EXPECT_THAT(segment_paths({{"kind", "points"}}), ElementsAre("/segments/0"));
  EXPECT_THAT(segment_paths({{"kind", "reversals"}, {"rate", 1}}), ElementsAre("/segments/0"));
}

TEST(Validation, KnowsWhatGoesTogetherInReversals) {
  json s = {{"kind", "reversals"}, {"rate", 1}, {"points", {1}}, {"first", 2}, {"hold_back", 1}, {"rise", 1}};
  EXPECT_THAT(segment_paths(s), UnorderedElementsAre("/segments/0/first", "/segments/0/back_to"));
  s.erase("first");
  s["back_to"] = 0;
  EXPECT_THAT(segment_paths(s), ElementsAre("/segments/0/rise"));
  s["order"] = 3;
  EXPECT_THAT(segment_paths(s), ElementsAre("/segments/0/through"));
  s["through"] = 0;
  EXPECT_THAT(segment_paths(s), IsEmpty());
  s["points"] = json::array();
  EXPECT_THAT(segment_paths(s), ElementsAre("/segments/0/points"));
  EXPECT_THAT(segment_paths({{"kind", "reversals"}, {"rate", 1}, {"count", 3}}),
              UnorderedElementsAre("/segments/0/first", "/segments/0/last"));
  EXPECT_THAT(segment_paths({{"kind", "reversals"}, {"rate", 1}, {"points", {1}}, {"order", 2}}),
              ElementsAre("/segments/0/back_to"));
}

TEST(Validation, KnowsWhatASmallSignalNeeds) {
  EXPECT_THAT(segment_paths({{"kind", "small_signal"}}),
              UnorderedElementsAre("/segments/0/levels", "/segments/0/rate", "/segments/0/settle",
                                   "/segments/0/amplitude", "/segments/0/frequency"));
  json s = {{"kind", "small_signal"}, {"levels", {1}},  {"rate", 1},  {"settle", 0},
            {"amplitude", 0.1},       {"frequency", 1}, {"cycles", 3}};
  EXPECT_THAT(segment_paths(s), IsEmpty());
  s["cycles"] = 2;
  s["amplitude"] = 0;
  EXPECT_THAT(segment_paths(s), UnorderedElementsAre("/segments/0/cycles", "/segments/0/amplitude"));
  s["cycles"] = 3;
  s["amplitude"] = 0.1;
  s["levels"] = json::array();
  EXPECT_THAT(segment_paths(s), ElementsAre("/segments/0/levels"));
  s["levels"] = {0, 2e6};
  const auto problems = validate(program(json::array({s})));
  ASSERT_EQ(problems.size(), 1U);
  EXPECT_EQ(problems[0].unit, "kV/mm");
}

TEST(Validation, ChecksEachPoint) {
  const json rows = {{0, 0}, {0, 1}, {1, 2, 3}, {2, 1e9}, {1, 0}};
  EXPECT_THAT(segment_paths({{"kind", "points"}, {"points", rows}}),
              ElementsAre("/segments/0/points/1", "/segments/0/points/2", "/segments/0/points/3",
                          "/segments/0/points/4"));
  const auto problems = validate(program({{{"kind", "points"}, {"csv", "0,0\n1,x\n2,inf\n"}}}));
  ASSERT_EQ(problems.size(), 2U);
  EXPECT_EQ(problems[0].path, "/segments/0/csv");
  EXPECT_THAT(problems[0].message, HasSubstr("line 2"));
  EXPECT_THAT(problems[1].message, HasSubstr("line 3"));
  EXPECT_THAT(segment_paths({{"kind", "points"}, {"csv", ""}}), ElementsAre("/segments/0/csv"));
  EXPECT_THAT(segment_paths({{"kind", "points"}, {"csv", "0,0\n0,1\n"}}), ElementsAre("/segments/0/csv"));
}

TEST(Validation, KnowsWhatCanBeAveraged) {
  const auto repeat = nlohmann::json::parse(
      R"({"kind": "repeat", "count": 3, "average": true, "segments": [{"kind": "hold", "time": 1}]})");
  EXPECT_TRUE(validate(program(nlohmann::json::array({repeat}))).empty());
  const auto path_of = [](const nlohmann::json& segments) {
    const auto found = validate(program(segments));
    return found.size() == 1 ? found[0].path : std::to_string(found.size());
  };
  auto few = repeat;
  few["count"] = 2;
  EXPECT_EQ(path_of(nlohmann::json::array({few})), "/segments/0/count");
  EXPECT_EQ(path_of(nlohmann::json::array({repeat, repeat})), "/segments/1/average");
  const nlohmann::json around{
      {"kind", "repeat"}, {"count", 2}, {"segments", nlohmann::json::array({repeat})}};
  EXPECT_EQ(path_of(nlohmann::json::array({around})), "/segments/0/segments/0/average");
}

TEST(Validation, RefusesWhatCannotBePlayed) {
  EXPECT_THAT(segment_paths({{"kind", "triangle"}, {"low", 1}, {"high", 1}, {"rate", 1}}),
              ElementsAre("/segments/0/low"));
  EXPECT_THAT(segment_paths({{"kind", "pund"}, {"amplitude", 0}, {"width", 1}, {"delay", 1}, {"rise", 1}}),
              ElementsAre("/segments/0/amplitude"));
  EXPECT_THAT(segment_paths({{"kind", "pund"}, {"amplitude", 1}, {"width", 1}, {"delay", 1}, {"rise", 0}}),
              ElementsAre("/segments/0/rise"));
  EXPECT_THAT(segment_paths({{"kind", "ramp"}, {"to", 1}, {"time", 1e-30}}), ElementsAre("/segments/0"));
  EXPECT_THAT(segment_paths({{"kind", "points"}, {"points", {{0, 1}}}}), ElementsAre("/segments/0"));
  EXPECT_THAT(segment_paths({{"kind", "ramp"}, {"to", 0}, {"rate", 1}}), ElementsAre("/segments"));
  EXPECT_THAT(paths(program(json::array())), ElementsAre("/segments"));
  EXPECT_THAT(segment_paths({{"kind", "hold"}, {"time", 1}, {"label", "a\nb"}}),
              ElementsAre("/segments/0/label"));
}

TEST(Validation, NamesUnknownParametersOnce) {
  auto given = program({{{"kind", "ramp"}, {"to", "$tpo"}, {"rate", 1}}});
  given["parameters"] = {{"top", 1}, {"2nd", 1}, {"word", "x"}};
  const auto problems = validate(given);
  EXPECT_THAT(paths(given), UnorderedElementsAre("/parameters/2nd", "/parameters/word", "/segments/0/to"));
  EXPECT_EQ(problems.back().hint, "did you mean \"$top\"?");
}

TEST(Validation, TellsProblemsInTheUnitOfTheFile) {
  auto given = program({{{"kind", "ramp"}, {"to", 1e7}, {"rate", -1}}});
  for (const std::string unit : {"kV/mm", "V"}) {
    given["unit"] = unit;
    const auto problems = validate(given);
    ASSERT_EQ(problems.size(), 2U);
    EXPECT_EQ(problems[0].unit, unit);
    EXPECT_EQ(problems[1].unit, unit + "/s");
  }
}

TEST(Validation, RefusesNull) {
  EXPECT_THAT(segment_paths({{"kind", "ramp"}, {"to", 1}, {"rate", nullptr}}),
              ElementsAre("/segments/0/rate"));
  auto given = program(json::array({hold}));
  given["title"] = nullptr;
  given["load"] = nullptr;
  EXPECT_THAT(paths(given), UnorderedElementsAre("/title", "/load"));
}

TEST(Validation, EscapesPaths) {
  auto given = program(json::array({hold}));
  given["a/b~c"] = 1;
  EXPECT_THAT(paths(given), ElementsAre("/a~1b~0c"));
}

}  // namespace
}  // namespace ferrobench::protocols

#include "base/fields.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

namespace ferrobench {
namespace fields_test {

using nlohmann::json;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;
using testing::UnorderedElementsAre;

enum class Color { red, green };
std::span<const std::pair<Color, std::string_view>> enum_names(Color) {
  static constexpr std::pair<Color, std::string_view> names[] = {{Color::red, "red"},
                                                                 {Color::green, "green"}};
  return names;
}

struct Inner {
  double stiffness = 2;
  std::optional<double> preload;
};
template <class Visitor>
void describe(Visitor& visit, Inner& s) {
  visit("stiffness", s.stiffness, {.unit = "N/m", .min = 0, .exclusive_min = true, .required = true});
  visit("preload", s.preload, {.unit = "N", .max = 10});
}

struct Outer {
  bool on = false;
  std::int64_t count = 1;
  std::uint8_t small = 0;
  std::string name = "none";
  Color color = Color::red;
  std::vector<Inner> springs;
  json extra;
};
template <class Visitor>
void describe(Visitor& visit, Outer& s) {
  visit("on", s.on, {});
  visit("count", s.count, {.min = 1, .max = 5});
  visit("small", s.small, {});
  visit("name", s.name, {.doc = "what it is called"});
  visit("color", s.color, {});
  visit("springs", s.springs, {});
  visit("extra", s.extra, {});
}

std::vector<std::string> paths(const json& given) {
  Outer outer;
  std::vector<Problem> problems;
  read_json(given, outer, "", problems);
  std::vector<std::string> out;
  for (const auto& problem : problems) out.push_back(problem.path);
  return out;
}

TEST(Fields, AreReadAndWrittenAlike) {
  const json given = {{"on", true},
                      {"count", 3},
                      {"small", 255},
                      {"name", "k"},
                      {"color", "green"},
                      {"springs", {{{"stiffness", 1.5}}, {{"stiffness", 2.0}, {"preload", -1.0}}}},
                      {"extra", {{"any", {1, 2}}}}};
  const auto outer = parse<Outer>(given, ErrorCode::bad_model, "the test");
  EXPECT_EQ(outer.color, Color::green);
  EXPECT_EQ(outer.springs.at(1).preload, -1);
  EXPECT_EQ(write_json(outer), given);
}

TEST(Fields, KeepTheirDefaultsWhereNothingIsGiven) {
  const auto outer = parse<Outer>(json::object(), ErrorCode::bad_model, "the test");
  EXPECT_EQ(outer.count, 1);
  EXPECT_EQ(outer.name, "none");
  EXPECT_EQ(parse<Outer>({{"count", 2.0}}, ErrorCode::bad_model, "the test").count, 2);
}

TEST(Fields, ReportEveryProblemWithItsPlace) {
  EXPECT_THAT(
      paths({{"on", 1},
             {"count", 6},
             {"small", 256},
             {"name", 7},
             {"color", "blue"},
             {"springs", {{{"stiffness", 0}}, 3, json::object(), {{"stiffness", 1}, {"preload", 11}}}},
             {"nmae", 1}}),
      UnorderedElementsAre("/on", "/count", "/small", "/name", "/color", "/springs/0/stiffness", "/springs/1",
                           "/springs/2/stiffness", "/springs/3/preload", "/nmae"));
  EXPECT_THAT(paths({{"small", -1}}), SizeIs(1));
  EXPECT_THAT(paths({{"count", 1.5}}), SizeIs(1));
  EXPECT_THAT(paths({{"springs", {{{"stiffness", std::nan("")}}}}}), SizeIs(1));
  EXPECT_THAT(paths({{"springs", {{{"stiffness", 1}, {"preload", nullptr}}}}}), IsEmpty());
}

TEST(Fields, StopReportingAtTheCap) {
  EXPECT_THAT(paths({{"springs", std::vector<int>(100000, 1)}}), SizeIs(max_problems));
}

TEST(Fields, MakeASchema) {
  const auto schema = json_schema<Outer>();
  EXPECT_EQ(schema["additionalProperties"], false);
  EXPECT_EQ(schema["properties"]["count"],
            (json{{"type", "integer"}, {"minimum", 1.0}, {"maximum", 5.0}, {"default", 1}}));
  EXPECT_EQ(schema["properties"]["color"]["enum"], (json{"red", "green"}));
  EXPECT_EQ(schema["properties"]["name"]["description"], "what it is called");
  const auto& spring = schema["properties"]["springs"]["items"];
  EXPECT_EQ(spring["required"], json::array({"stiffness"}));
  EXPECT_EQ(spring["properties"]["stiffness"]["exclusiveMinimum"], 0);
  EXPECT_EQ(spring["properties"]["preload"]["x-unit"], "N");
}

TEST(JsonText, SaysTheLineWhereItBreaks) {
  try {
    parse_json_text("{\"a\": 1,\n\"b\": }", ErrorCode::bad_model, "the model");
    FAIL() << "accepted";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::bad_model);
    EXPECT_THAT(error.message(), HasSubstr("line 2"));
  }
  EXPECT_EQ(parse_json_text("{\"a\": [{\"a\": 1}, {\"a\": 2}]}", ErrorCode::bad_model, "it")["a"].size(), 2U);
  EXPECT_THROW(parse_json_text("{\"a\": {\"b\": 1, \"b\": 2}}", ErrorCode::bad_model, "it"), Error);
  EXPECT_THROW(parse_json_text("[[[1]]]", ErrorCode::bad_model, "it", 100, 2), Error);
  EXPECT_THROW(parse_json_text("[1,2,3]", ErrorCode::bad_model, "it", 5), Error);
}

TEST(NearestName, IsFoundForATypoAndNotForAnythingElse) {
  const std::vector<std::string> names{"ramp", "hold", "repeat"};
  EXPECT_EQ(nearest_name("rmap", names), "ramp");
  EXPECT_EQ(nearest_name("repaet", names), "repeat");
  EXPECT_EQ(nearest_name("xyzzy", names), "");
}

TEST(NearestName, NeighboursThatChangedPlacesAreOneMistake) {
  EXPECT_EQ(nearest_name("shwo", std::vector<std::string>{"slow", "show"}), "show");
  EXPECT_EQ(nearest_name("rum", std::vector<std::string>{"fit", "run"}), "run");
}

TEST(NearestName, IsNoWordThatSharesALetterOfAShortOne) {
  EXPECT_EQ(nearest_name("osc", std::vector<std::string>{"virtual", "usb", "replay"}), "");
}

TEST(NearestName, IsWhatWasBegun) {
  EXPECT_EQ(nearest_name("soft", std::vector<std::string>{"nec-ae0505d08", "soft-pzt"}), "soft-pzt");
}

TEST(Excerpt, IsShortAndPrintable) {
  EXPECT_EQ(excerpt("a\n\xff\xc3\xa9"), "a????");
  EXPECT_EQ(excerpt(std::string(1000, 'x')).size(), 80U);
}

}  // namespace fields_test
}  // namespace ferrobench

// Input made to hurt: it must be refused quickly, with an Error and nothing else.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/fields.h"
#include "tests/protocols/programs.h"

namespace ferrobench::protocols {
namespace {

using nlohmann::json;
using testing::HasSubstr;
using testing::Le;
using testing::SizeIs;

void expect_refused(const std::string& text, const std::string& what) {
  try {
    Protocol::from_text(text);
    FAIL() << "accepted " << text.substr(0, 60);
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::bad_protocol);
    EXPECT_THAT(error.what(), HasSubstr(what));
    EXPECT_NO_THROW(error.data().dump());
  }
}

json nested(int depth, int count) {
  json inner = {{{"kind", "hold"}, {"time", 1e-6}}};
  for (int i = 0; i < depth; ++i)
    inner = json::array({{{"kind", "repeat"}, {"count", count}, {"segments", inner}}});
  return inner;
}

TEST(Hostile, NestingIsBounded) {
  EXPECT_THAT(validate(program(nested(8, 1))), SizeIs(0));
  const auto problems = validate(program(nested(9, 1)));
  ASSERT_THAT(problems, SizeIs(1));
  EXPECT_THAT(problems[0].message, HasSubstr("nested too deeply"));
  EXPECT_THAT(validate(program(nested(2000, 1))), testing::Not(SizeIs(0)));
  expect_refused(std::string(100000, '['), "nested deeper");
}

TEST(Hostile, WorkIsBounded) {
  const auto many = validate(program(nested(8, 1000000)));
  ASSERT_THAT(many, SizeIs(1));
  EXPECT_THAT(many[0].message, HasSubstr("too long"));

  json nothing = {{{"kind", "ramp"}, {"to", 0}, {"rate", 1}}};
  for (int i = 0; i < 8; ++i)
    nothing = json::array({{{"kind", "repeat"}, {"count", 1000000}, {"segments", nothing}}});
  EXPECT_THAT(validate(program(nothing)), SizeIs(1));

  const json cycles = {{"kind", "triangle"}, {"low", 0}, {"high", 1}, {"rate", 1e6}, {"cycles", 1000000}};
  EXPECT_THAT(validate(program(json::array({cycles}))), SizeIs(1));
}

TEST(Hostile, DurationIsBounded) {
  const json day = {{"kind", "repeat"}, {"count", 1000}, {"segments", {{{"kind", "hold"}, {"time", 86400}}}}};
  const auto problems = validate(program(json::array({day})));
  ASSERT_THAT(problems, SizeIs(1));
  EXPECT_EQ(problems[0].path, "/segments/0/segments/0");
  EXPECT_THAT(problems[0].message, HasSubstr("last too long"));
}

TEST(Hostile, NumbersThatAreNoneAreRefused) {
  const auto with = [](const std::string& number) {
    return R"({"format":"ferrobench-protocol","version":1,"name":"x","unit":"V","segments":[{"kind":"hold","time":)" +
           number + "}]}";
  };
  EXPECT_NO_THROW(Protocol::from_text(with("1")));
  for (const char* number :
       {"1e999", "-1e999", "NaN", "Infinity", "1e8", "true", "\"1\"", "[1]", "{}", "null"})
    expect_refused(with(number), "");
}

TEST(Hostile, CountsThatAreNoneAreRefused) {
  for (const auto& count :
       {json(-1), json(0), json(1.5), json(1e300), json(18446744073709551615ULL), json("2")}) {
    const json repeat = {{"kind", "repeat"}, {"count", count}, {"segments", nested(0, 1)}};
    const auto problems = validate(program(json::array({repeat})));
    ASSERT_THAT(problems, SizeIs(1)) << count;
    EXPECT_EQ(problems[0].path, "/segments/0/count");
  }
}

TEST(Hostile, ProblemsAreCapped) {
  const json many(100000, 7);
  EXPECT_THAT(validate(program(many)), SizeIs(Le(2 * max_problems)));
  EXPECT_THAT(validate(program({{{"kind", "points"}, {"points", many}}})), SizeIs(Le(2 * max_problems)));
  json keys = program(nested(0, 1));
  for (int i = 0; i < 10000; ++i) keys["key" + std::to_string(i)] = i;
  EXPECT_THAT(validate(keys), SizeIs(Le(2 * max_problems)));
  keys = program(nested(0, 1));
  for (int i = 0; i < 10000; ++i) keys["parameters"]["2nd" + std::to_string(i)] = i;
  EXPECT_THAT(validate(keys), SizeIs(Le(2 * max_problems)));
  std::string lines;
  for (int i = 0; i < 10000; ++i) lines += "x,y,z\n";
  EXPECT_THAT(validate(program({{{"kind", "points"}, {"csv", lines}}})), SizeIs(Le(2 * max_problems)));
}

TEST(Hostile, TextIsRefusedWhereItBreaks) {
  expect_refused("", "not JSON");
  expect_refused("{\"format\":", "not JSON");
  expect_refused("{\"a\": \"\xff\xfe\"}", "not JSON");
  expect_refused("{\"a\": 1, \"a\": 2}", "twice");
  expect_refused(std::string(17U << 20, ' '), "too long");
  expect_refused("[]", "object");
}

// Every place of a good program takes every kind of wrong value: refused or played, never anything else.
TEST(Hostile, WrongTypesAnywhereAreHandled) {
  const json good =
      program({{{"kind", "ramp"}, {"to", 1}, {"rate", 1}, {"label", "x"}},
               {{"kind", "reversals"}, {"points", {1, 2}}, {"rate", 1}, {"back_to", 0}, {"hold", 1}},
               {{"kind", "triangle"}, {"low", 0}, {"high", 1}, {"frequency", 1}, {"first", "down"}},
               {{"kind", "sine"}, {"amplitude", 1}, {"frequency", 1}},
               {{"kind", "pund"}, {"amplitude", 1}, {"width", 1}, {"delay", 1}, {"rise", 1}},
               {{"kind", "small_signal"},
                {"levels", {1, -1}},
                {"rate", 1},
                {"settle", 1},
                {"amplitude", 0.1},
                {"frequency", 10}},
               {{"kind", "points"}, {"points", {{0, 1}, {1, 2}}}},
               {{"kind", "points"}, {"csv", "0,1\n1,2\n"}},
               {{"kind", "repeat"}, {"count", 2}, {"segments", {{{"kind", "hold"}, {"time", 1}}}}}});
  ASSERT_THAT(validate(good), SizeIs(0));
  const json values = {nullptr,
                       true,
                       -1,
                       0,
                       1e308,
                       9007199254740993,
                       "",
                       "$x",
                       "-$",
                       json::array(),
                       json::object(),
                       {{1, 2}},
                       "\xc3\xa9\xc3\xa9"};
  int refused = 0;
  const auto flat = good.flatten();
  for (const auto& [place, ignored] : flat.items()) {
    for (const auto& value : values) {
      auto bad = good;
      bad[json::json_pointer(place)] = value;
      const auto problems = validate(bad);
      for (const auto& problem : problems) EXPECT_NO_THROW(to_json(problem).dump());
      if (problems.empty()) {
        EXPECT_GT(Protocol::from_json(bad).expand({.layer_thickness = 1e-4}).duration(), 0);
      } else {
        ++refused;
      }
    }
  }
  EXPECT_GT(refused, 300);
}

}  // namespace
}  // namespace ferrobench::protocols

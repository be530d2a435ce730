#include "base/error.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <set>

namespace ferrobench {
namespace {

TEST(ErrorTable, ListsEveryCodeOnceInOrder) {
  std::set<int> numbers;
  std::set<std::string_view> names;
  int index = 0;
  for (const auto& row : error_table()) {
    EXPECT_EQ(static_cast<int>(row.code), index++);
    EXPECT_EQ(entry(row.code).name, row.name);
    EXPECT_FALSE(row.meaning.empty());
    numbers.insert(row.rpc_code);
    names.insert(row.name);
  }
  EXPECT_EQ(numbers.size(), error_table().size());
  EXPECT_EQ(names.size(), error_table().size());
  EXPECT_EQ(static_cast<int>(ErrorCode::internal) + 1, index);
}

TEST(Error, CarriesItsProblems) {
  const Error error(ErrorCode::bad_protocol, "the protocol is not valid",
                    {{.path = "/segments/0/rate",
                      .message = "is outside its range",
                      .given = -1,
                      .allowed = {{"from", 0}},
                      .unit = "kV/mm/s",
                      .hint = "turn it round"},
                     {.message = "is empty"}});
  EXPECT_STREQ(
      error.what(),
      "the protocol is not valid\n"
      "  /segments/0/rate: is outside its range: -1 kV/mm/s; allowed: at least 0 kV/mm/s (turn it round)\n"
      "  is empty");
  const auto data = error.data();
  EXPECT_EQ(data["name"], "bad_protocol");
  EXPECT_EQ(data["problems"][0]["unit"], "kV/mm/s");
  EXPECT_EQ(data["problems"][1], (nlohmann::json{{"path", ""}, {"message", "is empty"}}));
}

TEST(Error, QuotesTextThatIsNotUtf8) {
  const Error error(ErrorCode::bad_protocol, "no", Problem{.message = "is odd", .given = "\xff"});
  EXPECT_THAT(error.what(), testing::HasSubstr("is odd: \""));
}

TEST(Error, IsToldInWordsAndNotInJson) {
  const auto told = [](Problem problem) {
    const std::string text = Error(ErrorCode::bad_protocol, "no", std::move(problem)).what();
    return text.substr(std::string("no\n  ").size());
  };
  EXPECT_EQ(told({.path = "/a",
                  .message = "is too fast",
                  .given = 1000.0,
                  .allowed = {{"to", 100.0}},
                  .unit = "kV/mm/s"}),
            "/a: is too fast: 1000 kV/mm/s; allowed: at most 100 kV/mm/s");
  EXPECT_EQ(told({.message = "is odd", .given = "x", .allowed = {{"from", 0.01}, {"to", 1e9}}}),
            "is odd: \"x\"; allowed: 0.01 to 1e+09");
  EXPECT_EQ(told({.message = "is odd", .allowed = {{"above", 0}, {"to", 7}}}),
            "is odd; allowed: above 0, at most 7");
  EXPECT_EQ(told({.message = "is odd", .given = {1, "b"}, .allowed = {"a", "b", "c"}}),
            "is odd: [1, b]; allowed: a, b or c");
  EXPECT_EQ(told({.message = "is odd", .given = {{"a", {1, 2}}}}), "is odd: an object");
  EXPECT_EQ(told({.path = "/x",
                  .message = "is not known",
                  .given = "b c",
                  .allowed = {"bc", "d"},
                  .hint = "did you mean \"bc\"?"}),
            "/x: is not known: \"b c\"; did you mean \"bc\"? Allowed: bc or d");
  EXPECT_EQ(told({.given = "/dev/full"}), "\"/dev/full\"");
  EXPECT_EQ(told({.message = "is odd", .allowed = std::vector<int>(100, 7)}).size(),
            std::string("is odd; allowed: ").size() + 40 + 39 * 2 + std::string(" and 60 more").size());
}

}  // namespace
}  // namespace ferrobench

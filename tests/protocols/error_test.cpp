#include "protocols/common/error.h"

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
      "  /segments/0/rate: is outside its range; given -1; allowed {\"from\":0} kV/mm/s (turn it round)\n"
      "  is empty");
  const auto data = error.data();
  EXPECT_EQ(data["name"], "bad_protocol");
  EXPECT_EQ(data["problems"][0]["unit"], "kV/mm/s");
  EXPECT_EQ(data["problems"][1], (nlohmann::json{{"path", ""}, {"message", "is empty"}}));
}

TEST(Error, QuotesTextThatIsNotUtf8) {
  const Error error(ErrorCode::bad_protocol, "no", Problem{.message = "is odd", .given = "\xff"});
  EXPECT_THAT(error.what(), testing::HasSubstr("is odd; given"));
}

}  // namespace
}  // namespace ferrobench

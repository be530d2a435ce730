// The table of the thresholds counts rightly, and a threshold that there is not is refused.
#include "tests/campaign/thresholds.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

namespace ferrobench::campaign {
namespace {

std::string line(int bench, const std::string& threshold, double factor, const std::string& named, bool right,
                 double seconds) {
  return nlohmann::json{
             {"bench", bench},
             {"threshold", threshold},
             {"factor", factor},
             {"outcome", {{"verdict", "named"}, {"named", {named}}, {"right", right}, {"seconds", seconds}}}}
             .dump() +
         "\n";
}

TEST(Thresholds, ATableCountsWhatChangedAgainstTheAnswersAsTheyAre) {
  const std::string log = testing::TempDir() + "ferrobench-thresholds-table";
  std::ofstream(log) << line(0, "", 1, "contact_gap", true, 10) << line(1, "", 1, "self_heating", false, 30)
                     << line(0, "detection", 0.5, "self_heating", false, 10)
                     << line(1, "detection", 0.5, "self_heating", false, 30)
                     << line(0, "detection", 2, "contact_gap", true, 10)
                     << line(1, "detection", 2, "stage_inertia", true, 10)
                     << line(2, "detection", 2, "of a bench that was not asked as it is", true, 10)
                     << R"({"bench": 1, "thre)";
  EXPECT_EQ(table_of_thresholds(log),
            "| threshold | value | halved: answers that change (right ones lost, won), time | doubled |\n"
            "| --- | --- | --- | --- |\n"
            "| `detection` | 60 | 1 of 2 (1 lost, 0 won), 1.00 | 1 of 2 (0 lost, 1 won), 0.50 |\n");
  std::filesystem::remove(log);
}

TEST(Thresholds, OneThatThereIsNotIsRefusedWithThoseThatThereAre) {
  const std::string log = testing::TempDir() + "ferrobench-thresholds-refused";
  try {
    ask_with_other_thresholds({.benches = testing::TempDir(), .log = log, .only = {"patience"}});
    FAIL();
  } catch (const Error& e) {
    EXPECT_EQ(e.code(), ErrorCode::invalid_params);
    EXPECT_THAT(e.what(), testing::HasSubstr("material_share"));
  }
  EXPECT_FALSE(std::filesystem::exists(log)) << "nothing was asked";
}

}  // namespace
}  // namespace ferrobench::campaign

// Damaged copies of testers' files: tests/imports/README.md.
#include <gtest/gtest.h>
#include <unistd.h>

#include "tests/imports/damaged_tables.h"

namespace ferrobench::imports {
namespace {

TEST(DamagedTables, AreRefusedOrSayWhatIsWrong) {
  const auto folder = std::filesystem::temp_directory_path() / ("damaged-tables-" + std::to_string(getpid()));
  const auto figures = damage_tables(all_files(), 500, 1, folder);
  EXPECT_TRUE(figures.failures.empty()) << figures;
  const auto all = figures.sum();
  EXPECT_EQ(all.copies, 500);
  // A digit of the thickness in a header that says it once, and the like.
  EXPECT_LE(all.silent, 2) << figures;
  std::filesystem::remove_all(folder);
}

}  // namespace
}  // namespace ferrobench::imports

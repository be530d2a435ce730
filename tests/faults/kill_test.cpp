#include "tests/faults/kill.h"

#include <gtest/gtest.h>

#include <iostream>

namespace ferrobench::faults {
namespace {

TEST(Kill, NothingAcknowledgedIsLostAndNothingInvented) {
  const auto folder = std::filesystem::temp_directory_path() / ("kill-" + std::to_string(getpid()));
  auto figures = kill_runs(30, 1, folder);
  const int opened = open_with_h5py(folder, figures.failures);
  std::cout << figures << "h5py opened " << opened << " files.\n";
  EXPECT_TRUE(figures.failures.empty());
  EXPECT_GT(figures.rows_recovered, 0u);
  EXPECT_GT(figures.outcomes[0], 0);
  EXPECT_NE(opened, 0);  // -1 without h5py
  std::filesystem::remove_all(folder);
}

}  // namespace
}  // namespace ferrobench::faults

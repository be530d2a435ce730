#include "server/cli/deadline.h"

#include <gtest/gtest.h>

namespace ferrobench::cli {
namespace {

using namespace std::chrono_literals;

TEST(Deadline, WhatIsOverInTimeIsLeftAlone) {
  const auto begin = std::chrono::steady_clock::now();
  {
    const Deadline deadline(10s, [] { return "too late"; });
  }
  EXPECT_LT(std::chrono::steady_clock::now() - begin, 5s);
}

TEST(DeadlineDeathTest, WhatHangsIsEndedWithLastWords) {
  GTEST_FLAG_SET(death_test_style, "threadsafe");
  EXPECT_EXIT(
      {
        const Deadline deadline(100ms, [] { return "the disk hangs"; });
        std::this_thread::sleep_for(60s);
      },
      testing::ExitedWithCode(1), "ferrobench: the disk hangs");
}

TEST(DeadlineDeathTest, ABenchThatSaysNothingIsMistrusted) {
  GTEST_FLAG_SET(death_test_style, "threadsafe");
  EXPECT_EXIT(
      {
        const Deadline deadline(100ms, [] {
          std::this_thread::sleep_for(60s);
          return "";
        });
        std::this_thread::sleep_for(60s);
      },
      testing::ExitedWithCode(1), "switch the amplifier off");
}

}  // namespace
}  // namespace ferrobench::cli

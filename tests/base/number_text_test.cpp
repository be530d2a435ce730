#include "base/number_text.h"

#include <gtest/gtest.h>

#include <cmath>

namespace ferrobench {
namespace {

TEST(NumberText, HasFourDigits) {
  EXPECT_EQ(number_text(1234.567), "1235");
  EXPECT_EQ(number_text(-0.0), "0");
  EXPECT_EQ(number_text(1.23456e-9), "1.235e-09");
}

TEST(NumberText, OfAnIntervalTellsItsEndsApart) {
  using Ends = std::pair<std::string, std::string>;
  EXPECT_EQ(interval_text(1, 2), Ends("1", "2"));
  EXPECT_EQ(interval_text(1.19301e-9, 1.19308e-9), Ends("1.19301e-09", "1.19308e-09"));
  EXPECT_EQ(interval_text(-1e6 - 1, -1e6), Ends("-1000001", "-1000000"));
  EXPECT_EQ(interval_text(0.5, 0.5), Ends("0.5", "0.5"));
  EXPECT_EQ(interval_text(NAN, 1).second, "1");
}

}  // namespace
}  // namespace ferrobench

// Two recordings side by side.
#include "recordings/analysis/difference.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/recordings/sample.h"

namespace ferrobench::recordings {
namespace {

const std::vector<testing::Step> steps{{1e6, 1}, {1e6, 1}, {-1e6, 2}, {0, 1}};

const ColumnDifference& field_of(const Difference& d) {
  return *std::ranges::find(d.columns, std::string(channel_place(Channel::field)),
                            &ColumnDifference::dataset);
}

TEST(Difference, OfTwoSamplingRatesIsTakenAtCommonTimes) {
  const auto slow = testing::play(0, steps, 100), fast = testing::play(0, steps, 1000);
  for (const auto& [a, b] : {std::pair(&slow, &fast), std::pair(&fast, &slow)}) {
    const auto d = compare(*a, *b);
    EXPECT_TRUE(d.by_time);
    EXPECT_FALSE(d.same_samples());
    EXPECT_EQ(d.common, slow.size());
    EXPECT_LT(field_of(d).maximum, 1) << "one program, in V/m";
    EXPECT_TRUE(std::isnan(d.columns.front().rms)) << "the times themselves";
    EXPECT_NE(to_json(d)["note"].get<std::string>().find(std::to_string(fast.size())), std::string::npos);
    EXPECT_TRUE(to_json(d)["columns"][0]["rms"].is_null());
  }
}

TEST(Difference, OfOneSamplingRateIsTakenRowByRow) {
  const auto whole = testing::play(0, steps, 100);
  auto part = testing::play(0, {steps[0], steps[1]}, 100);
  part.channels[static_cast<std::size_t>(Channel::field)]->at(3) += 7;
  for (auto& t : part.time) t += 1e-9;  // another clock
  const auto d = compare(whole, part);
  EXPECT_FALSE(d.by_time);
  EXPECT_NEAR(field_of(d).maximum, 7, 1e-9);
  EXPECT_EQ(to_json(d)["note"], "");
}

}  // namespace
}  // namespace ferrobench::recordings

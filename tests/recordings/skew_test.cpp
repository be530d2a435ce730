#include "recordings/analysis/skew.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "recordings/reports/report.h"
#include "tests/recordings/sample.h"

namespace ferrobench::recordings {
namespace {

constexpr double rate = 1e5;  // rows/s
constexpr double skew = 8e-6;

nlohmann::json multiplexed() {
  return {{"driver", "usb"},
          {"channels",
           {{{"channel", "field"}, {"skew_s", 0.0}}, {{"channel", "displacement"}, {"skew_s", skew}}}}};
}

// A triangle of displacement, read `skew` after each row.
Recording skewed() {
  auto r = testing::play(0, {{1e6, 0.01}, {0, 0.01}}, rate);
  r.header.device = multiplexed();
  auto& x = r.set(Channel::displacement);
  for (const double t : r.time) x.push_back(1e-6 - 1e-4 * std::abs(t + skew - 0.01));
  return r;
}

TEST(Skew, IsTakenOutOfWhatIsLinear) {
  auto r = skewed();
  ASSERT_TRUE(remove_skew(r));
  const auto& x = r.at(Channel::displacement);
  std::size_t off = 0;
  for (std::size_t i = 1; i < x.size(); ++i)
    off += std::abs(x[i] - (1e-6 - 1e-4 * std::abs(r.time[i] - 0.01))) > 1e-15 ? 1 : 0;
  EXPECT_LE(off, 1U);  // the sample after the corner
  EXPECT_EQ(r.at(Channel::field), skewed().at(Channel::field));
}

TEST(Skew, LeavesGapsAndWhatIsNotSaid) {
  auto r = skewed();
  r.channels[static_cast<std::size_t>(Channel::displacement)]->at(50) =
      std::numeric_limits<double>::quiet_NaN();
  const auto before = r.at(Channel::displacement);
  remove_skew(r);
  EXPECT_TRUE(std::isnan(r.at(Channel::displacement)[50]));
  EXPECT_EQ(r.at(Channel::displacement)[51], before[51]);
  EXPECT_EQ(r.at(Channel::displacement)[0], before[0]);
  auto plain = skewed();
  plain.header.device = {{"driver", "virtual"}};
  const auto same = plain.at(Channel::displacement);
  EXPECT_FALSE(remove_skew(plain));
  EXPECT_EQ(plain.at(Channel::displacement), same);
}

TEST(Skew, OfAReplayIsThatOfWhatItPlays) {
  const nlohmann::json replay{{"driver", "replay"}, {"recorded_with", multiplexed()}};
  EXPECT_EQ(skew_of(replay), skew_of(multiplexed()));
  EXPECT_EQ(skew_of(replay)[static_cast<std::size_t>(Channel::displacement)], skew);
}

TEST(Skew, TrustsNoDescription) {
  const std::array<double, 5> none{};
  for (const char* text :
       {R"(null)", R"([])", R"({"channels": 1})", R"({"channels": [1, {}]})",
        R"({"channels": [{"channel": 1, "skew_s": 1}]})",
        R"({"channels": [{"channel": "field", "skew_s": -1}]})",
        R"({"channels": [{"channel": "field", "skew_s": "1"}]})", R"({"recorded_with": 3})"})
    EXPECT_EQ(skew_of(nlohmann::json::parse(text)), none) << text;
  auto r = skewed();
  r.header.device["channels"][1]["skew_s"] = 1.0;  // longer than a row: not to be interpolated
  const auto before = r.at(Channel::displacement);
  remove_skew(r);
  EXPECT_EQ(r.at(Channel::displacement), before);
}

TEST(Skew, IsSaidInTheReport) {
  const auto recording = skewed();
  const auto report = make_report(recording);
  const auto said = std::ranges::find_if(report.facts, [](const auto& f) { return f.first == "channels"; });
  ASSERT_NE(said, report.facts.end());
  EXPECT_NE(said->second.find("8 µs"), std::string::npos) << said->second;
}

}  // namespace
}  // namespace ferrobench::recordings

#include "recordings/analysis/mean_of_passes.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "protocols/protocol.h"
#include "recordings/reports/report.h"

namespace ferrobench::recordings {
namespace {

constexpr double rate = 100;  // Hz

nlohmann::json program(int count) {
  return {{"format", "ferrobench-protocol"},
          {"version", 1},
          {"name", "loops"},
          {"title", "Loops"},
          {"unit", "kV/mm"},
          {"start", 0},
          {"sample_rate_Hz", rate},
          {"segments",
           {{{"kind", "hold"}, {"time", 0.5}},
            {{"kind", "repeat"},
             {"count", count},
             {"average", true},
             {"segments",
              {{{"kind", "ramp"}, {"to", 1}, {"rate", 1}},
               {{"kind", "hold"}, {"time", 0.303}},  // so that passes lie differently on the samples
               {{"kind", "ramp"}, {"to", -1}, {"rate", 2}},
               {{"kind", "ramp"}, {"to", 0}, {"rate", 1}, {"label", "home"}}}}},
            {{"kind", "ramp"}, {"to", 0.5}, {"rate", 1}}}}};
}

// Displacement of 1e-5 m per 1e6 V/m; the first pass is 1e-6 m off, and each pass drifts by 1e-7 m.
double displacement_of(double field, std::size_t pass) {
  return 1e-11 * field + (pass == 1 ? 1e-6 : 0) + 1e-7 * static_cast<double>(pass);
}

Recording recorded(int count, double noise, unsigned seed = 1) {
  const protocols::SampledWaveform s(protocols::Protocol::from_json(program(count)).expand(), rate);
  const auto& begin = s.waveform().averaged()->begin;
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  Recording r;
  r.header.title = "Loops";
  r.header.start_time = "2026-01-01T12:00:00.000000Z";
  r.header.entry_identifier = "one";
  r.header.protocol = program(count);
  r.header.device = {{"driver", "test"}};
  r.header.specimen = {"stack", 0.01, 1e-4, 1e-4, 100};
  r.header.past = {.kind = protocols::PastKind::poled_plus};
  r.header.charge_reference = ChargeReference::first_sample;
  for (std::size_t k = 0; k + 1 < s.corners().size(); ++k) {
    const auto& row = s.waveform().segments()[k];
    r.segments.push_back(
        {static_cast<std::int64_t>(s.corners()[k]),
         static_cast<std::int64_t>(s.corners()[k + 1] + (k + 2 == s.corners().size() ? 1 : 0)), row.kind,
         row.label, row.level, row.rate});
    std::size_t pass = 0;
    while (pass < begin.size() && begin[pass] <= k) ++pass;
    for (auto i = s.corners()[k]; i < s.corners()[k + 1] + (k + 2 == s.corners().size() ? 1 : 0); ++i) {
      r.time.push_back(static_cast<double>(i) / rate);
      if (i == 0) {
        for (const auto c : {Channel::command, Channel::field, Channel::charge, Channel::displacement})
          r.set(c);
      }
      const double field = s.value(i);
      r.channels[0]->push_back(field);
      r.channels[1]->push_back(field + 1e3 * noise * normal(random));
      r.channels[2]->push_back(1e-10 * field + 1e-6);
      r.channels[3]->push_back(displacement_of(field, pass) + 1e-8 * noise * normal(random));
    }
  }
  return r;
}

TEST(MeanOfPasses, LeavesOutTheFirst) {
  const auto r = recorded(5, 0);
  const auto mean = mean_of_passes(r);
  ASSERT_TRUE(mean);
  EXPECT_EQ(mean->passes, (std::vector<std::size_t>{2, 3, 4, 5}));
  EXPECT_EQ(mean->in_words(), "passes 2 to 5");
  EXPECT_TRUE(mean->left_out.empty());
  const auto& m = mean->recording;
  EXPECT_EQ(m.time.front(), 0);
  EXPECT_NEAR(m.time.back(), 1 + 0.303 + 1 + 1, 1 / rate);
  ASSERT_EQ(m.segments.size(), 4U);
  EXPECT_EQ(m.segments[3].end_sample, static_cast<std::int64_t>(m.size()));
  // Passes 2 to 5 drift about 3.5e-7 m; where samples of a pass lie between those of another the field tells.
  // The last sample is the next pass's first.
  for (std::size_t i = 0; i + 1 < m.size(); ++i)
    EXPECT_NEAR(m.at(Channel::displacement)[i], 1e-11 * m.at(Channel::field)[i] + 3.5e-7, 1e-12) << i;
  EXPECT_EQ(m.at(Channel::charge).front(), 0);  // as its reference says
  EXPECT_FALSE(m.raw);
}

TEST(MeanOfPasses, IsARecordingOfOnePass) {
  const auto mean = mean_of_passes(recorded(4, 1));
  ASSERT_TRUE(mean);
  const auto& h = mean->recording.header;
  EXPECT_EQ(h.title, "Loops, mean of passes 2 to 4");
  EXPECT_EQ(h.start_time, "2026-01-01T12:00:03.800000Z");  // 0.5 s and a pass later
  EXPECT_EQ(h.device["mean_of"]["source_identifier"], "one");
  EXPECT_EQ(h.device["mean_of"]["passes"], nlohmann::json({2, 3, 4}));
  const auto own = protocols::Protocol::from_json(h.protocol).expand();
  EXPECT_FALSE(own.averaged());
  ASSERT_EQ(own.pieces().size(), mean->recording.segments.size());
  for (std::size_t k = 0; k < own.pieces().size(); ++k)
    EXPECT_EQ(own.segments()[k].label, mean->recording.segments[k].label);
  // A hold, and the first pass's corners.
  ASSERT_EQ(h.past.kind, protocols::PastKind::visited);
  ASSERT_EQ(h.past.levels.size(), 5U);
  EXPECT_EQ(h.past.levels[1].field, 1e6);
  EXPECT_NEAR(h.past.levels[2].seconds, 0.303, 1e-12);
  EXPECT_EQ(h.past.levels[3].field, -1e6);
  EXPECT_FALSE(mean_of_passes(mean->recording));
}

TEST(MeanOfPasses, StatesTheNoiseOfTheMeanWithoutTheDrift) {
  constexpr int passes = 10;
  const auto r = recorded(passes + 1, 1);
  const auto mean = mean_of_passes(r);
  ASSERT_TRUE(mean);
  const auto noise = mean->recording.noise[static_cast<std::size_t>(Channel::displacement)];
  ASSERT_TRUE(noise);
  EXPECT_NEAR(*noise, 1e-8 / std::sqrt(passes), 0.1e-8 / std::sqrt(passes));
  // And that is what it has.
  double squares = 0;
  const auto& m = mean->recording;
  const protocols::SampledWaveform s(protocols::Protocol::from_json(program(passes + 1)).expand(), rate);
  for (std::size_t i = 0; i + 1 < m.size(); ++i)
    squares += std::pow(m.at(Channel::displacement)[i] - 1e-11 * m.at(Channel::command)[i] - 6.5e-7, 2);
  EXPECT_NEAR(std::sqrt(squares / static_cast<double>(m.size())), *noise, 0.15 * *noise);
}

TEST(MeanOfPasses, LeavesOutWhatWasPausedOrBrokenOff) {
  auto r = recorded(5, 0);
  // The hold of pass 3 is 2 s longer, and the run ends in pass 5.
  const auto hold = std::ranges::find(r.segments, "hold 4", &SegmentRow::label);
  ASSERT_NE(hold, r.segments.end());
  for (auto i = static_cast<std::size_t>(hold->end_sample); i < r.size(); ++i) r.time[i] += 2;
  const auto last = std::ranges::find(r.segments, "hold 6", &SegmentRow::label);
  r.segments.erase(last + 1, r.segments.end());
  const auto end = static_cast<std::size_t>(last->end_sample);
  r.time.resize(end);
  for (auto& channel : r.channels)
    if (channel) channel->resize(end);
  const auto mean = mean_of_passes(r);
  ASSERT_TRUE(mean);
  EXPECT_EQ(mean->in_words(), "passes 2 and 4");
  ASSERT_EQ(mean->left_out.size(), 2U);
  EXPECT_EQ(mean->left_out[0], "Pass 3 is 1.997 s longer in \"hold 4\".");
  EXPECT_EQ(mean->left_out[1], "Pass 5 was not played to its end.");
  const auto report = render(make_report(r), Format::text);
  EXPECT_NE(report.find("Mean of passes 2 and 4"), std::string::npos) << report;
  EXPECT_NE(report.find("Pass 3 is 1.997 s longer"), std::string::npos);
}

TEST(MeanOfPasses, IsNoneWithoutTwoWholePassesAfterTheFirst) {
  auto r = recorded(3, 0);
  ASSERT_TRUE(mean_of_passes(r));
  for (auto& row : r.segments)
    if (row.label == "hold 4") row.label = "another";
  EXPECT_FALSE(mean_of_passes(r));
  r = recorded(3, 0);
  r.header.protocol["segments"][1].erase("average");
  EXPECT_FALSE(mean_of_passes(r));
  r.header.protocol = "nonsense";
  EXPECT_FALSE(mean_of_passes(r));
}

}  // namespace
}  // namespace ferrobench::recordings

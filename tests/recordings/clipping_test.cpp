// Values made of samples past a converter's range are marked in every table and format.
#include "recordings/analysis/clipping.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "recordings/reports/report.h"
#include "recordings/tables/comparison.h"
#include "tests/recordings/sample.h"

namespace ferrobench::recordings {
namespace {

using nlohmann::json;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;

// Two holds. In the first the displacement creeps by 3 um, in the second the converter ends it at 32 um.
Recording clipped_recording() {
  auto r = testing::play(0, {{1e6, 2}, {1e6, 15}, {2e6, 2}, {2e6, 15}, {0, 2}}, 100);
  auto& x = r.set(Channel::displacement);
  auto& raw = r.raw.emplace();
  raw.columns = {{Channel::displacement, 1e-9, 0}};
  for (std::size_t i = 0; i < r.size(); ++i) {
    const double t = r.time[i];
    const double creep = t < 2 ? 0 : std::min((t - 2) / 15, 1.0) * 3e-6;
    const double value = 15e-12 * r.at(Channel::field)[i] + creep;
    const auto count = std::clamp<long>(std::lround(value / 1e-9), -32768, 32767);
    raw.counts.push_back(static_cast<std::int16_t>(count));
    x.push_back(1e-9 * static_cast<double>(count));
  }
  x[50] = std::nan("");  // a gap is no clipping
  raw.counts[50] = -32768;
  return r;
}

TEST(Clipping, IsKnownFromTheCounts) {
  const auto r = clipped_recording();
  const Clipping clipping(r);
  const std::array displacement{Channel::displacement}, field{Channel::field};
  EXPECT_FALSE(clipping.any(displacement, 0, 1700));
  EXPECT_TRUE(clipping.any(displacement, 0, r.size() - 1));
  EXPECT_TRUE(clipping.any(displacement, 2500, 2500));
  EXPECT_FALSE(clipping.any(displacement, 3590, r.size() - 1));
  EXPECT_FALSE(clipping.any(field, 0, r.size() - 1));
  EXPECT_THAT(clipping.in_words(Channel::displacement), HasSubstr("displacement: "));
}

TEST(Clipping, IsKnownFromTheEventsWhereThereAreNoCounts) {
  auto r = clipped_recording();
  r.raw.reset();
  EXPECT_FALSE(Clipping(r).any(std::array{Channel::displacement}, 0, r.size() - 1));
  r.events = {{20, "clipped", "displacement is past the converter's range"}, {5, "note", "force"}};
  EXPECT_TRUE(Clipping(r).any(std::array{Channel::displacement}, 1999, 2001));
  EXPECT_FALSE(Clipping(r).any(std::array{Channel::displacement}, 0, 1999));
  EXPECT_FALSE(Clipping(r).any(std::array{Channel::force}, 0, r.size() - 1));
}

TEST(Clipping, MarksTheCellsOfAReportInEveryFormat) {
  const auto r = clipped_recording();
  const auto report = make_report(r);
  const auto out = json::parse(render(report, Format::json));
  const auto& creep = out["creep"]["rows"];
  ASSERT_EQ(creep.size(), 2u);
  EXPECT_FALSE(creep[0].contains("clipped"));
  EXPECT_NEAR(creep[0]["displacement_change_um"].get<double>(), 3, 0.01);
  EXPECT_TRUE(creep[1]["displacement_change_um"].is_number());
  EXPECT_THAT(creep[1]["clipped"].get<std::vector<std::string>>(),
              ::testing::Contains("displacement_change_um"));
  EXPECT_THAT(creep[1]["clipped"].get<std::vector<std::string>>(),
              Not(::testing::Contains("field_kV_per_mm")));
  EXPECT_THAT(out["creep"]["notes"].dump(), HasSubstr("displacement: "));
  for (const auto& row : out["stroke"]["rows"])
    EXPECT_THAT(row["clipped"].get<std::vector<std::string>>(), ElementsAre("stroke_um", "strain_percent"));
  EXPECT_THAT(render(report, Format::text), HasSubstr("32.77 !"));
  EXPECT_THAT(render(report, Format::text), HasSubstr("end of the converter's range"));
  EXPECT_THAT(render(report, Format::md), HasSubstr("32.77 !"));
  EXPECT_THAT(render(report, Format::html), HasSubstr("<td class=\"clipped\">32.77 !</td>"));
  const auto csv = render(report, Format::csv);
  EXPECT_THAT(csv, HasSubstr(",clipped\n"));
  EXPECT_THAT(csv, HasSubstr(",stroke_um strain_percent\n"));
}

TEST(Clipping, AnUnclippedReportSaysNothingOfIt) {
  auto r = clipped_recording();
  for (auto& x : r.set(Channel::displacement) = std::vector<double>(r.size())) x = 1e-6;
  r.raw->counts.assign(r.size(), 1000);
  const auto report = make_report(r);
  for (const auto format : {Format::text, Format::md, Format::csv, Format::json})
    EXPECT_THAT(render(report, format), Not(HasSubstr("clipped"))) << static_cast<int>(format);
  EXPECT_THAT(render(report, Format::text), Not(HasSubstr(" !")));
}

TEST(Clipping, AClippedCellOfAPublishedTableIsMarkedAndCountsForNoError) {
  const auto table = published_table("3.11");
  const auto cell = *std::ranges::find(table.cells, "displacement_change_um", &PublishedCell::quantity);
  const double level = cell.key("field_kV_per_mm") * 1e6;
  auto r = testing::play(1.5e6, {{level, 2}, {level, 15}, {1.5e6, 2}}, 100);
  r.header.load.prestress = cell.key("prestress_MPa") * 1e6;
  auto& x = r.set(Channel::displacement);
  for (const double t : r.time) x.push_back(-1e-6 * std::clamp((t - 2) / 15, 0.0, 1.0));
  auto& raw = r.raw.emplace();
  raw.columns = {{Channel::displacement, 1e-9, 0}};
  raw.counts.assign(r.size(), 0);
  const auto sound = compare(table, std::span(&r, 1));
  EXPECT_TRUE(sound.rms_log_error.contains("displacement_change_um"));
  EXPECT_EQ(render(sound, Format::text).find(" !"), std::string::npos);

  for (std::size_t i = 1000; i < 1100; ++i) raw.counts[i] = -32768;
  const auto clipped = compare(table, std::span(&r, 1));
  EXPECT_FALSE(clipped.rms_log_error.contains("displacement_change_um"));
  const auto out = to_json(clipped);
  int marked = 0;
  for (const auto& item : out["cells"]) {
    if (item["measured"].is_null()) continue;
    EXPECT_EQ(item["clipped"], true);
    EXPECT_TRUE(item["measured"].is_number());
    ++marked;
  }
  EXPECT_EQ(marked, 1);
  for (const auto format : {Format::text, Format::md, Format::html})
    EXPECT_THAT(render(clipped, format), HasSubstr("1 !")) << static_cast<int>(format);
  EXPECT_THAT(render(clipped, Format::csv), HasSubstr(",measured error_percent\n"));
  EXPECT_THAT(render(clipped, Format::text), HasSubstr("not known (displacement)"));
}

}  // namespace
}  // namespace ferrobench::recordings

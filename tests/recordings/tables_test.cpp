// Published tables: the numbers shipped, and what is measured for them in recordings that are known in closed
// form.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <sstream>

#include "base/error.h"
#include "recordings/exchange/export.h"
#include "recordings/tables/comparison.h"
#include "tests/recordings/sample.h"

namespace ferrobench::recordings {
namespace {

TEST(PublishedTables, AreWhole) {
  EXPECT_EQ(published_table("3.10").cells.size(), 32u);
  EXPECT_EQ(published_table("3.11").cells.size(), 18u);
  EXPECT_EQ(published_table("3.12").cells.size(), 18u);
  EXPECT_EQ(published_table("3.13").cells.size(), 4u);
  const auto table = published_table("3.11");
  EXPECT_TRUE(table.cells[0].doubtful);
  EXPECT_FALSE(table.cells[1].doubtful);
  EXPECT_EQ(table.cells[3].quantity, "displacement_change_um");
  EXPECT_EQ(table.cells[3].key("prestress_MPa"), 4);
  EXPECT_EQ(table.cells[3].key("field_kV_per_mm"), -0.55);
  EXPECT_EQ(table.cells[3].published, 4.6);
  EXPECT_EQ(table.cells[0].uncertainty, 0.4);
  EXPECT_EQ(table.cells[1].uncertainty, 0.2);
  EXPECT_EQ(published_table("3.13").cells[0].uncertainty, 0.005);
  EXPECT_THAT(published_table("3.13").run_values(), ::testing::ElementsAre(5, 50, 500, 5000));
  EXPECT_EQ(published_table("3.10").run_key(), nullptr);
  EXPECT_EQ(published_tables_in_words(), "3.10, 3.11, 3.12 or 3.13");
  EXPECT_THROW(published_table("3.1"), Error);
  EXPECT_THROW(published_table("../3.10"), Error);
}

// Holds at the table's levels in which displacement and polarization change by `factor` times the published
// values.
Recording holds_of(const PublishedTable& table, double prestress, double factor) {
  std::vector<testing::Step> steps;
  std::vector<double> levels;
  for (const auto& cell : table.cells) {
    const bool of_this = table.name == "3.10" ? cell.quantity == "displacement_range_um"
                                              : cell.key("prestress_MPa") == prestress / 1e6;
    if (!of_this) continue;
    levels.push_back(cell.key("field_kV_per_mm") * 1e6);
    steps.insert(steps.end(), {{levels.back(), 2}, {levels.back(), 15}, {1.5e6, 2}, {1.5e6, 5}});
  }
  auto r = testing::play(1.5e6, steps, 50);
  r.header.load.prestress = prestress;
  auto &x = r.set(Channel::displacement), &q = r.set(Channel::charge);
  x.assign(r.size(), 0);
  q.assign(r.size(), 0);
  std::size_t level = 0;
  for (const auto& row : r.segments) {
    if (row.kind != "hold" || row.level == 1.5e6) continue;
    for (const auto& cell : table.cells) {
      if (cell.key("field_kV_per_mm") * 1e6 != levels[level]) continue;
      if (table.name != "3.10" && cell.key("prestress_MPa") != prestress / 1e6) continue;
      const bool displacement = cell.quantity.starts_with("displacement");
      const double change = -factor * cell.published * (displacement ? 1e-6 : 2.5e-3);
      for (auto i = row.start_sample; i <= row.end_sample; ++i)
        (displacement ? x : q)[static_cast<std::size_t>(i)] =
            change * static_cast<double>(i - row.start_sample) /
            static_cast<double>(row.end_sample - row.start_sample);
    }
    ++level;
  }
  return r;
}

TEST(Comparison, CreepTablesFindTheirHoldsByPrestressAndField) {
  for (const auto* name : {"3.11", "3.12"}) {
    const auto table = published_table(name);
    const std::vector<Recording> recordings{holds_of(table, 16e6, 1.1), holds_of(table, 4e6, 1.1),
                                            holds_of(table, 8e6, 1.1)};
    const auto json = to_json(compare(table, recordings));
    EXPECT_EQ(json["table"], name);
    ASSERT_EQ(json["cells"].size(), 18u);
    for (const auto& cell : json["cells"])
      EXPECT_NEAR(cell["measured"].get<double>(), 1.1 * cell["published"].get<double>(), 1e-6) << cell;
    const auto quantity = json["cells"][0]["quantity"].get<std::string>();
    EXPECT_NEAR(json["rms_log_error"][quantity].get<double>(), std::log(1.1), 1e-6);
  }
}

TEST(Comparison, ArbitraryUnitsAreScaledByOneFactor) {
  const auto table = published_table("3.10");
  const auto comparison = compare(table, std::vector{holds_of(table, 10.6e6, 0.25)});
  EXPECT_NEAR(comparison.rms_log_error.at("polarization_range"), 0, 1e-9);
  EXPECT_NEAR(comparison.scale.at("polarization_range"), 4, 1e-6);
  EXPECT_NEAR(comparison.rms_log_error.at("displacement_range_um"), std::log(4), 1e-9);
  EXPECT_THAT(render(comparison, Format::text), ::testing::HasSubstr("arbitrary units"));
}

TEST(Comparison, StrokesAreFoundByRate) {
  auto r = testing::play(0, {{1.5e6, 0.3}, {0, 0.3}, {1.5e6, 3}, {0, 3}}, 1000);
  auto& x = r.set(Channel::displacement);
  for (std::size_t i = 0; i < r.size(); ++i)
    x.push_back((r.time[i] < 0.6 ? 2e-11 : 2.7e-11) * r.at(Channel::command)[i]);
  const auto comparison = compare(published_table("3.13"), std::vector{r});
  EXPECT_FALSE(comparison.cells[0].measured);
  EXPECT_NEAR(*comparison.cells[1].measured, 40.5, 1e-9);
  EXPECT_NEAR(*comparison.cells[2].measured, 30, 0.1);
  EXPECT_FALSE(comparison.cells[3].measured);
  const auto json = nlohmann::json::parse(render(comparison, Format::json));
  EXPECT_TRUE(json["cells"][0]["measured"].is_null());
  EXPECT_EQ(json["cells"][1]["rate_V_per_s"], 50);
  for (const auto format : {Format::text, Format::md, Format::csv, Format::html})
    EXPECT_THAT(render(comparison, format), ::testing::HasSubstr("max_stroke_um"));
}

TEST(Export, CsvAndJsonGiveEverySampleInFull) {
  auto r = testing::play(0, {{1.0 / 3, 1}}, 3);
  r.set(Channel::displacement) = {0, 1.1e-7, std::nan(""), 3.3e-7};
  std::ostringstream csv;
  export_csv(r, csv);
  EXPECT_THAT(csv.str(),
              ::testing::StartsWith("time_s,command_V_per_m,field_V_per_m,displacement_m\n0,0,0,0\n"));
  EXPECT_THAT(csv.str(), ::testing::HasSubstr(",\n"));
  EXPECT_THAT(csv.str(), ::testing::EndsWith("1,0.3333333333333333,0.3333333333333333,3.3e-07\n"));
  std::ostringstream text;
  export_json(r, text);
  const auto json = nlohmann::json::parse(text.str());
  EXPECT_EQ(json["columns"]["displacement_m"].size(), 4u);
  EXPECT_TRUE(json["columns"]["displacement_m"][2].is_null());
  EXPECT_EQ(json["columns"]["field_V_per_m"][3], 1.0 / 3);
  EXPECT_EQ(json["segments"][0]["end_sample"], 3);
}

}  // namespace
}  // namespace ferrobench::recordings

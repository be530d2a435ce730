// Field programs in CSV: their units are understood or refused, never guessed.
#include "protocols/csv.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>

#include "base/headings.h"
#include "protocols/protocol.h"

namespace ferrobench::protocols {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

struct Given {
  PointTable table;
  std::vector<Problem> problems;
};
Given given(const std::string& headings, std::optional<Unit> unit = {}) {
  Given out;
  out.table = read_points(headings + "\n0,0\n2,3\n", "/csv", unit, out.problems);
  return out;
}

TEST(Headings, AreANameAndAUnit) {
  for (const auto& [text, name, unit] : std::vector<std::tuple<std::string, std::string, std::string>>{
           {"field_kV_per_mm", "field", "kV_per_mm"},
           {"field [kV/mm]", "field", "kV/mm"},
           {"E (kV/mm)", "E", "kV/mm"},
           {"voltage_V", "voltage", "V"},
           {"U/V", "U", "V"},
           {"U / kV", "U", "kV"},
           {"E/(kV/mm)", "E", "kV/mm"},
           {"E/kV/mm", "E", "kV/mm"},
           {"time_s", "time", "s"},
           {"t [ms]", "t", "ms"},
           {"applied_field_MV_per_m", "applied_field", "MV_per_m"},
           {"Voltage V", "Voltage", "V"},
           {"kV/mm", "", "kV/mm"},
           {"field kV/mm", "field", "kV/mm"},
           {"field_kV/mm", "field", "kV/mm"},
           {"E / kV/mm", "E", "kV/mm"},
           {"polarization uC/cm2", "polarization", "uC/cm2"},
           {"polarization_uC/cm2", "polarization", "uC/cm2"},
           {"current uA", "current uA", ""},
           {"field_Oe", "field", "Oe"},
           {"field_statV_per_cm", "field", "statV_per_cm"},
           {"x (furlong)", "x", "furlong"},
           {"E / kV mm^-1", "E", "kV mm^-1"},
           {"time in s", "time", "s"},
           {"field in kV/mm", "field", "kV/mm"},
           {"Field in [kV/mm]", "Field", "kV/mm"},
           {"time", "time", ""},
           {"elapsed_time", "elapsed_time", ""},
           {"channel_1", "channel_1", ""},
           {"Applied field", "Applied field", ""},
           {"", "", ""}}) {
    const auto heading = read_heading(text);
    EXPECT_EQ(heading.name, name) << text;
    EXPECT_EQ(heading.unit, unit) << text;
  }
}

TEST(Headings, HaveUnitsThatAreKnown) {
  for (const auto& [text, si] :
       std::vector<std::pair<std::string, double>>{{"V", 1},
                                                   {"kV", 1e3},
                                                   {"V/m", 1},
                                                   {"kV/mm", 1e6},
                                                   {"MV/m", 1e6},
                                                   {"kV_per_mm", 1e6},
                                                   {"ms", 1e-3},
                                                   {"min", 60},
                                                   {"\xc2\xb5m", 1e-6},
                                                   {"\xce\xbc"
                                                    "C",
                                                    1e-6},
                                                   {"nm", 1e-9},
                                                   {"mN", 1e-3},
                                                   {"kV mm^-1", 1e6},
                                                   {"V m-1", 1},
                                                   {"kV mm^{-1}", 1e6},
                                                   {"kV\xc2\xb7mm\xe2\x81\xbb\xc2\xb9", 1e6},
                                                   {"MV*m^\xe2\x88\x92"
                                                    "1",
                                                    1e6}}) {
    ASSERT_NE(find_unit(text), nullptr) << text;
    EXPECT_EQ(find_unit(text)->si, si) << text;
  }
  constexpr std::array of_polarization{Quantity::polarization};
  for (const std::string text : {"uC/cm2",
                                 "\xc2\xb5"
                                 "C/cm\xc2\xb2",
                                 "\xb5"
                                 "C/cm\xb2",
                                 "uC cm^-2", "uC cm-2",
                                 "\xc2\xb5"
                                 "C cm\xe2\x81\xbb\xc2\xb2"})
    EXPECT_NE(find_unit(text, of_polarization), nullptr) << text;
  constexpr std::array of_current{Quantity::current};
  EXPECT_EQ(read_heading("current uA", of_current).unit, "uA");
  for (const std::string text : {"kv", "S", "Oe", "", "kV/mm/s", "V/", "kV mm^-3", "kV^-1 mm", "-1", "V -1"})
    EXPECT_EQ(find_unit(text), nullptr) << text;
}

TEST(PointTables, AreInTheUnitsOfTheirHeadings) {
  struct Case {
    std::string headings;
    double time, level;
    Unit unit;
  };
  for (const auto& [headings, time, level, unit] :
       std::vector<Case>{{"time,level", 2, 3, Unit::kv_per_mm},
                         {"time_s,field_kV_per_mm", 2, 3, Unit::kv_per_mm},
                         {"t [ms],E (MV/m)", 2e-3, 3, Unit::kv_per_mm},
                         {"t / min,field [V/m]", 120, 3e-6, Unit::kv_per_mm},
                         {"t_us,E/(kV/m)", 2e-6, 3e-3, Unit::kv_per_mm},
                         {"time_s,voltage_V", 2, 3, Unit::volt},
                         {"time,U/V", 2, 3, Unit::volt},
                         {"time,U [kV]", 2, 3000, Unit::volt},
                         {"s,V", 2, 3, Unit::volt}}) {
    const auto found = given(headings);
    EXPECT_THAT(found.problems, IsEmpty()) << headings;
    ASSERT_EQ(found.table.points.size(), 2u) << headings;
    EXPECT_DOUBLE_EQ(found.table.points[1][0], time) << headings;
    EXPECT_DOUBLE_EQ(found.table.points[1][1], level) << headings;
    EXPECT_EQ(found.table.unit, unit) << headings;
  }
}

TEST(PointTables, RefuseUnitsThatAreNotUnderstood) {
  for (const auto& [headings, column, unit] : std::vector<std::tuple<std::string, std::string, std::string>>{
           {"time,field_Oe", "column 2 (field_Oe)", "Oe"},
           {"time,voltage_kv", "column 2 (voltage_kv)", "kv"},
           {"time,E [kV/in]", "column 2 (E [kV/in])", "kV/in"},
           {"time,field_s", "column 2 (field_s)", "s"},
           {"time,force_N", "column 2 (force_N)", "N"},
           {"time,voltage", "column 2 (voltage)", "voltage"},
           {"time,U", "column 2 (U)", "U"},
           {"time,V1", "column 2 (V1)", "V1"},
           {"t [fortnight],E", "column 1 (t [fortnight])", "fortnight"},
           {"voltage_V,time_s", "column 1 (voltage_V)", "V"}}) {
    const auto found = given(headings);
    ASSERT_THAT(found.problems, Not(IsEmpty())) << headings;
    EXPECT_THAT(found.problems[0].message, HasSubstr(column));
    EXPECT_EQ(found.problems[0].given, unit);
    EXPECT_TRUE(found.problems[0].allowed.is_array() && found.problems[0].allowed.size() > 3);
    EXPECT_THAT(found.table.points, IsEmpty());
  }
}

TEST(PointTables, GoWithTheUnitOfTheirProtocol) {
  EXPECT_THAT(given("time,U/kV", Unit::volt).problems, IsEmpty());
  EXPECT_EQ(given("time,level", Unit::volt).table.unit, Unit::volt);
  const auto found = given("time,U/kV", Unit::kv_per_mm);
  ASSERT_EQ(found.problems.size(), 1u);
  EXPECT_THAT(found.problems[0].message, HasSubstr("in another unit than the protocol"));
  const nlohmann::json protocol{
      {"format", "ferrobench-protocol"},
      {"version", 1},
      {"name", "a"},
      {"unit", "kV/mm"},
      {"segments", {{{"kind", "points"}, {"csv", "time_s,voltage_V\n0,0\n1,100\n"}}}}};
  const auto problems = validate(protocol);
  ASSERT_EQ(problems.size(), 1u);
  EXPECT_EQ(problems[0].path, "/segments/0/csv");
}

TEST(PointTables, HaveTwoColumnsWithoutGaps) {
  std::vector<Problem> problems;
  EXPECT_THAT(read_points("t,E,x\n0,1,2\n", "", {}, problems).points, IsEmpty());
  ASSERT_EQ(problems.size(), 1u);
  EXPECT_THAT(problems[0].message, HasSubstr("3 columns"));
  problems.clear();
  read_points("t,E\n0,1\n1,\n,3\n", "", {}, problems);
  ASSERT_EQ(problems.size(), 2u);
  EXPECT_EQ(problems[0].message, "line 3: column 2 (E) is empty");
  EXPECT_EQ(problems[1].message, "line 4: column 1 (t) is empty");
}

// A voltage becomes a field by the layer's thickness, as in a JSON protocol; without one it is refused.
TEST(PointTables, InVoltsNeedALayerThickness) {
  const auto path = testing::TempDir() + "volts.csv";
  std::ofstream(path) << "time_s;U/kV\n0;0\n1;0,2\n2;0\n";
  const auto protocol = Protocol::from_csv_file(path);
  std::filesystem::remove(path);
  EXPECT_EQ(protocol.json().at("unit"), "V");
  EXPECT_THROW(protocol.expand(), Error);
  EXPECT_DOUBLE_EQ(protocol.expand({.layer_thickness = 1e-4}).maximum(), 2e6);
}

}  // namespace
}  // namespace ferrobench::protocols

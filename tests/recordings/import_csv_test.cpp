// Tables in text as recordings: columns by name, number or heading; units given, read or refused.
#include "recordings/exchange/import_csv.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "recordings/exchange/export.h"

namespace ferrobench::recordings {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

CsvImport of(std::string csv) {
  CsvImport out;
  out.csv = std::move(csv);
  out.length = 0.01, out.area = 2.5e-5, out.layer_thickness = 1e-4;
  return out;
}

std::vector<Problem> problems_of(const CsvImport& import) {
  try {
    import_csv(import);
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::bad_recording);
    return error.problems();
  }
  ADD_FAILURE() << "accepted: " << import.csv;
  return {};
}

Recording exported() {
  Recording r;
  r.time = {0, 0.1, 0.2, 0.3};
  r.set(Channel::field) = {0, 1e5, 2e5, 1e5};
  r.set(Channel::displacement) = {0, 1e-7, NAN, 1.0 / 3e6};
  return r;
}

TEST(ImportCsv, GivesBackWhatWasExported) {
  const auto r = exported();
  std::ostringstream text;
  export_csv(r, text);
  auto import = of(text.str());
  for (const bool by_map : {false, true}) {
    if (by_map) {
      import.time = ColumnMap{.column = "time_s"};
      import.field = ColumnMap{.column = "field_V_per_m"};
      import.displacement = ColumnMap{.column = "displacement_m", .scale = 2};
    }
    const double scale = by_map ? 2 : 1;
    const auto back = import_csv(import);
    EXPECT_EQ(back.time, r.time);
    EXPECT_EQ(back.at(Channel::field), r.at(Channel::field));
    EXPECT_EQ(back.at(Channel::displacement)[3], scale / 3e6);
    EXPECT_TRUE(std::isnan(back.at(Channel::displacement)[2]));
    EXPECT_FALSE(back.has(Channel::charge));
  }
}

TEST(ImportCsv, NamesEverythingThatIsWrong) {
  std::ostringstream text;
  export_csv(exported(), text);
  auto import = of(text.str() + "0.3,x,0\n");
  import.time = ColumnMap{.column = "time_s"};
  import.field = ColumnMap{.column = "field_V_per_m"};
  import.force = ColumnMap{.column = "force_lbf"};
  const auto problems = problems_of(import);
  ASSERT_EQ(problems.size(), 3u);  // no such column, no number, time does not rise
  EXPECT_EQ(problems[0].path, "/force/column");
  EXPECT_EQ(problems[1].message, "line 6: column 2 (field_V_per_m) is not a number");
  EXPECT_EQ(problems[2].message, "line 6: the time does not rise");
}

TEST(ImportCsv, TakesUnitsFromHeadings) {
  const auto r = import_csv(
      of("time [ms];field (kV/mm);charge / uC;Displacement_um;force_kN\n0;0;0;0;0\n5;1,5;2;3;4\n"));
  EXPECT_THAT(r.time, ElementsAre(0, 5e-3));
  EXPECT_THAT(r.at(Channel::field), ElementsAre(0, 1.5e6));
  EXPECT_THAT(r.at(Channel::charge), ElementsAre(0, 2e-6));
  EXPECT_DOUBLE_EQ(r.at(Channel::displacement)[1], 3e-6);
  EXPECT_THAT(r.at(Channel::force), ElementsAre(0, 4000));
}

TEST(ImportCsv, TakesUnitsFromTheMap) {
  auto import = of("t_s,a_V,b_um,c\n0,0,0,0\n1,5,5,5\n");
  import.time = ColumnMap{.column = "t_s"};
  import.displacement = ColumnMap{.column = "a_V", .scale = 1e-9, .offset = 1};
  import.command = ColumnMap{.column = "b_um", .unit = "kV"};
  import.field = ColumnMap{.column = "c", .unit = "V/m", .scale = 3};
  const auto r = import_csv(import);
  EXPECT_DOUBLE_EQ(r.at(Channel::displacement)[1], 1 + 5e-9);
  EXPECT_DOUBLE_EQ(r.at(Channel::command)[1], 5e3 / 1e-4);
  EXPECT_DOUBLE_EQ(r.at(Channel::field)[1], 15);
}

// A scale of -1 alone would make amperes of microamperes.
TEST(ImportCsv, WantsTheUnitBesideAScaleWhereTheHeadingSaysOne) {
  auto import = of("time_s,field [kV/mm],current [uA]\n0,0,1\n1,1,1\n2,0,1\n");
  import.current = ColumnMap{.scale = -1};
  const auto problems = problems_of(import);
  ASSERT_EQ(problems.size(), 1u);
  EXPECT_EQ(problems[0].path, "/current/scale");
  EXPECT_EQ(problems[0].given, "uA");
  EXPECT_THAT(problems[0].hint, HasSubstr("current.unit"));
  import.current->unit = "uA";
  EXPECT_DOUBLE_EQ(import_csv(import).at(Channel::charge)[1], -1e-6);
}

TEST(ImportCsv, RefusesUnitsThatAreNotUnderstood) {
  auto problems = problems_of(of("time_s,force_lbf\n0,1\n1,2\n"));
  ASSERT_EQ(problems.size(), 1u);
  EXPECT_EQ(problems[0].path, "/force/column");
  EXPECT_EQ(problems[0].given, "lbf");
  EXPECT_THAT(problems[0].hint, HasSubstr("in the map"));
  problems = problems_of(of("time_V,force_N\n0,1\n1,2\n"));
  ASSERT_EQ(problems.size(), 1u);
  EXPECT_EQ(problems[0].path, "/time/column");
  auto import = of("time_s,x\n0,1\n1,2\n");
  import.time = ColumnMap{.column = "time_s"};
  import.charge = ColumnMap{.column = "x", .unit = "kV"};
  problems = problems_of(import);
  ASSERT_EQ(problems.size(), 1u);
  EXPECT_EQ(problems[0].path, "/charge/unit");
}

TEST(ImportCsv, TakesColumnsByNumberAndTimeFromARate) {
  auto import = of(",7.00,-13.9,-118.1\n,7.01,-14.0,-118.2\n,7.02,-14.1,-118.3\n");
  import.time = ColumnMap{.number = 2};
  import.field = ColumnMap{.number = 3, .unit = "V"};
  import.displacement = ColumnMap{.number = 4, .unit = "um"};
  const auto r = import_csv(import);
  EXPECT_THAT(r.time, ElementsAre(7, 7.01, 7.02));
  EXPECT_DOUBLE_EQ(r.at(Channel::field)[0], -13.9 / 1e-4);
  import.time.reset();
  import.sample_rate = 100;
  EXPECT_THAT(import_csv(import).time, ElementsAre(0, 0.01, 0.02));
  import.time = ColumnMap{.number = 2};
  EXPECT_EQ(problems_of(import)[0].path, "/sample_rate_Hz");
  import.sample_rate.reset();
  import.time = ColumnMap{.number = 5};
  EXPECT_EQ(problems_of(import)[0].path, "/time/number");
  import.time = ColumnMap{.column = "t"};
  EXPECT_THAT(problems_of(import)[0].hint, HasSubstr("number"));
  import.time = ColumnMap{};
  EXPECT_EQ(problems_of(import)[0].path, "/time");
}

TEST(ImportCsv, SaysWhatIsMissingOrThereTwice) {
  EXPECT_EQ(problems_of(of("a,b\n0,1\n1,2\n"))[0].path, "/time");
  EXPECT_EQ(problems_of(of("time_s,b\n0,1\n1,2\n"))[0].message, "has no column of a channel");
  EXPECT_EQ(problems_of(of("time_s,force_N\n0,1\n"))[0].message, "has fewer than two rows");
  auto import = of("t,x,x\n0,1,1\n1,2,2\n");
  import.time = ColumnMap{.column = "t"};
  import.force = ColumnMap{.column = "x"};
  EXPECT_THAT(problems_of(import)[0].message, HasSubstr("more than once"));
  EXPECT_THAT(problems_of(of("time_s,force_N\n0,1\n1,2,3\n2\n"))[0].message,
              HasSubstr("line 3: has 3 columns, not 2"));
}

TEST(ImportCsv, SaysHowToWriteAGap) {
  const auto problems = problems_of(of("time_s,force_N\n0,1\n1,--\n2,3\n"));
  ASSERT_EQ(problems.size(), 1u);
  EXPECT_EQ(problems[0].given, "--");
  EXPECT_THAT(problems[0].hint, HasSubstr("leave it empty or write NaN"));
}

TEST(ImportCsv, TakesOverloadsForGaps) {
  for (const std::string mark : {"9.91E+37", "-9.9e37", "199.999E+99"}) {
    std::string text = "time_s,field [kV/mm],charge [uC]\n";
    for (int i = 0; i < 40; ++i)
      text += std::to_string(i) + "," + std::to_string(i) + "," +
              (i >= 20 && i < 26 ? mark
               : i == 10         ? "500"
                                 : std::to_string(i)) +
              "\n";
    const auto r = import_csv(of(text));
    const auto& q = r.at(Channel::charge);
    EXPECT_TRUE(std::isnan(q[20]) && std::isnan(q[25])) << mark;
    EXPECT_DOUBLE_EQ(q[26], 26e-6);
    const auto findings = r.header.device["findings"].dump();
    EXPECT_THAT(findings,
                HasSubstr("6 cells mark an overload of the meter by " + mark + ", the first in line 22"));
    EXPECT_THAT(findings,
                HasSubstr("one sample of the charge lies far beside the others around, in line 12"));
  }
}

// The map wins, and what it does not name goes by its heading.
TEST(ImportCsv, ReadsByHeadingsWhatTheMapDoesNotName) {
  auto import = of("time [s],U [V],displacement [um],charge [uC]\n0,0,0,0\n1,150,2,1\n");
  import.field = ColumnMap{.column = "U [V]"};
  const auto r = import_csv(import);
  EXPECT_DOUBLE_EQ(r.at(Channel::field)[1], 1.5e6);
  EXPECT_DOUBLE_EQ(r.at(Channel::displacement)[1], 2e-6);
  EXPECT_DOUBLE_EQ(r.at(Channel::charge)[1], 1e-6);
  EXPECT_TRUE(r.others.empty());
  import.charge = ColumnMap{.column = "displacement [um]", .unit = "uC"};
  EXPECT_FALSE(import_csv(import).has(Channel::displacement));
  import = of("field,displacement [um]\n0,0\n150,2\n");
  import.sample_rate = 100;
  import.field = ColumnMap{.unit = "V"};
  EXPECT_THAT(import_csv(import).time, ElementsAre(0, 0.01));
  EXPECT_DOUBLE_EQ(import_csv(import).at(Channel::field)[1], 1.5e6);
}

TEST(ImportCsv, ReadsUnitsWithoutBracketsAndEitherSpelling) {
  for (const std::string heading : {"polarization uC/cm2", "polarization_uC/cm2",
                                    "Polarisation [\xc2\xb5"
                                    "C/cm\xc2\xb2]",
                                    "polarization [\xb5"
                                    "C/cm\xb2]"})
    EXPECT_DOUBLE_EQ(
        import_csv(of("time [s],field [V]," + heading + "\n0,0,0\n1,1,2\n")).at(Channel::charge)[1],
        2e-2 * 2.5e-5)
        << heading;
}

TEST(ImportCsv, ReadsSymbolsThatSayTheirUnit) {
  const auto r =
      import_csv(of("t / s,E / kV mm^-1,P [uC cm^-2],displacement in um,F (N)\n0,0,0,0,1\n1,1.5,2,3,4\n"));
  EXPECT_DOUBLE_EQ(r.at(Channel::field)[1], 1.5e6);
  EXPECT_DOUBLE_EQ(r.at(Channel::charge)[1], 2e-2 * 2.5e-5);
  EXPECT_DOUBLE_EQ(r.at(Channel::displacement)[1], 3e-6);
  EXPECT_DOUBLE_EQ(r.at(Channel::force)[1], 4);
  EXPECT_DOUBLE_EQ(import_csv(of("t [ms],U [V]\n0,0\n1,150\n")).at(Channel::field)[1], 1.5e6);
  EXPECT_DOUBLE_EQ(import_csv(of("t [s],E [V/m],voltage [V]\n0,7,0\n1,7,150\n")).at(Channel::field)[1], 1.5e6)
      << "a name goes before a symbol";
  // Without a unit, or with another quantity's, a letter is a name like any other.
  EXPECT_EQ(problems_of(of("time [s],E\n0,0\n1,1\n"))[0].message, "has no column of a channel");
  EXPECT_EQ(problems_of(of("time [s],F [um]\n0,0\n1,1\n"))[0].message, "has no column of a channel");
  EXPECT_THAT(problems_of(of("time [s],E\n0,0\n1,1\n"))[0].hint, HasSubstr("displacement [um]"));
}

TEST(ImportCsv, TellsAndKeepsColumnsThatAreNoChannel) {
  const auto r =
      import_csv(of("time [s],field [V],displacement 1 [um],displacement 2 [um],strain "
                    "[%],remark\n0,0,0,1,5,a\n1,1,1,2,6,\n"));
  EXPECT_FALSE(r.has(Channel::displacement));
  const auto findings = r.header.device["findings"].dump();
  EXPECT_THAT(
      findings,
      HasSubstr("columns not read as channels: displacement 1 [um], displacement 2 [um], strain [%]"));
  EXPECT_THAT(findings, HasSubstr("columns without numbers are not read: remark"));
  ASSERT_EQ(r.others.size(), 3u);
  EXPECT_EQ(r.others[1].as.name, "displacement_2");
  EXPECT_EQ(r.others[1].as.unit, "m");
  EXPECT_THAT(r.others[1].values, ElementsAre(1e-6, 2e-6));
  EXPECT_EQ(r.others[2].as.unit, "%");
}

TEST(ImportCsv, TakesAVoltageForTheFieldOnlyWithItsUnit) {
  EXPECT_DOUBLE_EQ(import_csv(of("time [s],voltage [V]\n0,0\n1,150\n")).at(Channel::field)[1], 1.5e6);
  EXPECT_DOUBLE_EQ(import_csv(of("time [s],voltage [V],field [V/m]\n0,0,0\n1,150,3\n")).at(Channel::field)[1],
                   3);
  auto import = of("time [s],voltage\n0,0\n1,150\n");
  for (const bool mapped : {false, true}) {
    if (mapped) import.field = ColumnMap{.column = "voltage"};
    const auto problems = problems_of(import);
    ASSERT_EQ(problems.size(), 1u);
    EXPECT_EQ(problems[0].path, "/field/column");
    EXPECT_THAT(problems[0].message, HasSubstr("is a voltage that says no unit"));
    EXPECT_THAT(problems[0].hint, HasSubstr("field.unit"));
  }
  import.field->unit = "V";
  EXPECT_DOUBLE_EQ(import_csv(import).at(Channel::field)[1], 1.5e6);
}

TEST(ImportCsv, TellsOnceWhereTheTimeDoesNotRise) {
  auto problems = problems_of(of("time [ms],field [V]\n0,1\n2,2\n2,3\n1,4\n"));
  ASSERT_EQ(problems.size(), 1u);
  EXPECT_EQ(problems[0].message, "line 4: the time does not rise");
  EXPECT_EQ(problems[0].given, "0.002 s after 0.002 s");
  EXPECT_THAT(problems[0].hint, HasSubstr("sample_rate_Hz"));
  problems = problems_of(of("time [s],field [V]\n0,1\n,2\n2,3\n"));
  ASSERT_EQ(problems.size(), 1u);
  EXPECT_EQ(problems[0].message, "line 3: the time is missing");
  problems = problems_of(of("time [s],field [V]\n0,1\nx,2\n2,3\n"));
  ASSERT_EQ(problems.size(), 1u);
  EXPECT_THAT(problems[0].message, HasSubstr("is not a number"));
}

TEST(ImportCsv, TellsOfARowOfUnits) {
  for (const std::string row : {"s,kV/mm,um", "[s],[kV/mm],[um]"}) {
    const auto problems = problems_of(of("time,field,displacement\n" + row + "\n0,0,0\n1,1,1\n"));
    ASSERT_EQ(problems.size(), 1u) << row;
    EXPECT_EQ(problems[0].message, "line 2: holds the units of the columns, and no samples");
  }
}

// A stage driven by a triangle, as its logger wrote it: no names, an empty first column.
TEST(ImportCsv, ReadsAMeasuredStage) {
  const auto path = std::filesystem::path(FERROBENCH_SOURCE).parent_path() / "shared" / "data" / "measured" /
                    "stage_hysteresis_1hz_7s_9s.csv";
  std::ifstream file(path);
  if (!file) GTEST_SKIP() << path << " is not there";
  auto import = of({std::istreambuf_iterator<char>(file), {}});
  import.time = ColumnMap{.number = 2};
  import.field = ColumnMap{.number = 3, .unit = "V"};
  import.displacement = ColumnMap{.number = 4, .unit = "um"};
  const auto r = import_csv(import);
  EXPECT_GT(r.size(), 5000u);
  EXPECT_NEAR(r.time.front(), 7, 1e-6);
  EXPECT_NEAR(r.time.back(), 9, 0.01);
  EXPECT_NEAR(r.at(Channel::displacement).front(), -118.05964e-6, 1e-12);
}

}  // namespace
}  // namespace ferrobench::recordings

// Testers' files as recordings: which kind, which samples, what was checked and what was found.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>

#include "base/number_text.h"
#include "base/text_file.h"
#include "recordings/exchange/import.h"
#include "recordings/file/reader.h"
#include "recordings/file/writer.h"
#include "recordings/reports/report.h"
#include "tests/imports/tester_files.h"

namespace ferrobench::recordings {
namespace {

using imports::Layout;
using testing::ElementsAre;
using testing::HasSubstr;

CsvImport of(std::string text) {
  CsvImport out;
  out.csv = std::move(text);
  return out;
}

CsvImport of_film(std::string text) {
  auto out = of(std::move(text));
  out.area = 1e-8, out.layer_thickness = 200e-9;
  return out;
}

std::vector<Imported> import(const std::string& text) {
  return import_tables(of(text), std::nullopt);
}

// All messages of one kind, one under the other.
std::string said(const Imported& table, const std::string& kind) {
  std::string out;
  for (const auto& f : table.findings)
    if (f.kind == kind) out += f.message + '\n';
  return out;
}

std::string refusal(const CsvImport& import, std::optional<SourceKind> kind = {}) {
  try {
    import_tables(import, kind);
  } catch (const Error& error) {
    return error.what();
  }
  return "accepted";
}

std::string replaced(std::string text, const std::string& from, const std::string& to) {
  const auto at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return text.replace(at, from.size(), to);
}

const std::vector<double>* other(const Recording& r, const std::string& name) {
  for (const auto& o : r.others)
    if (o.as.name == name) return &o.values;
  return nullptr;
}

TEST(Imports, KindsAreFoundByTheirFirstLines) {
  const auto kind = [](const std::string& text) { return detect_kind(text); };
  EXPECT_EQ(kind(imports::aixacct_piezo(1)), SourceKind::aixacct);
  EXPECT_EQ(kind(imports::aixacct_fatigue()), SourceKind::aixacct);
  EXPECT_EQ(kind(imports::radiant_hysteresis()), SourceKind::radiant);
  EXPECT_EQ(kind(imports::radiant_remanent()), SourceKind::radiant);
  EXPECT_EQ(kind(imports::easyexpert()), SourceKind::easyexpert);
  EXPECT_EQ(kind(imports::data_values()), SourceKind::data_values);
  EXPECT_EQ(kind("time_s;field [kV/mm]\n0;0\n1;0,5\n"), SourceKind::csv);
}

TEST(Imports, WhatIsOfNoKindOrOfTwoIsRefused) {
  EXPECT_THAT(refusal(of("")), HasSubstr("it is empty"));
  EXPECT_THAT(refusal(of("\x7f"
                         "ELF\x01\x02\n\x03")),
              HasSubstr("none of the kinds"));
  const auto both = refusal(of(imports::aixacct_piezo(1) + imports::data_values()));
  EXPECT_THAT(both, HasSubstr("it looks like an ASCII export of an aixACCT tester, and like DataValue rows"));
  EXPECT_THAT(both, HasSubstr("aixacct"));
  EXPECT_THAT(refusal(of("TemperatureResult\n\nTable 1\n")), HasSubstr("does not name a measurement"));
  EXPECT_THAT(refusal(of(imports::aixacct_piezo(1)), SourceKind::radiant), HasSubstr("the file ends here"));
}

TEST(Imports, ALoopOfACeramicWithItsDisplacement) {
  const auto tables = import(imports::aixacct_piezo(3, {.offset = 72}));
  ASSERT_EQ(tables.size(), 3u);
  const auto& r = tables[1].recording;
  EXPECT_EQ(r.size(), 201u);
  EXPECT_DOUBLE_EQ(r.header.specimen.area, 50e-6);
  EXPECT_DOUBLE_EQ(r.header.specimen.layer_thickness, 1e-3);
  EXPECT_DOUBLE_EQ(r.header.specimen.length, 1e-3);
  EXPECT_NEAR(r.at(Channel::field)[50], (1000 + 72) / 1e-3, 1);
  EXPECT_EQ(r.at(Channel::charge).front(), 0);
  EXPECT_EQ(r.header.charge_reference, ChargeReference::first_sample);
  EXPECT_TRUE(r.has(Channel::displacement));
  EXPECT_FALSE(r.has(Channel::force));
  EXPECT_FALSE(r.has(Channel::command));
  ASSERT_NE(other(r, "current"), nullptr);
  EXPECT_EQ(r.others.size(), 1u);  // the second loop is the first, the third was not measured
  EXPECT_THAT(said(tables[1], "warning"), HasSubstr("72 V above what was asked for (+-1000 V"));
  EXPECT_THAT(said(tables[1], "check"), HasSubstr("A dP against the integral of I dt"));
  EXPECT_THAT(said(tables[1], "check"), HasSubstr("so the thickness holds"));
  EXPECT_THAT(said(tables[1], "flag"), HasSubstr("Error: underflow"));
  EXPECT_THAT(said(tables[1], "flag"), HasSubstr("SingleLoop: YES"));
  EXPECT_THAT(said(tables[1], "note"),
              HasSubstr("P1 is taken, with V+; P2 is the same; P3 was not measured"));
  EXPECT_THAT(said(tables[0], "flag"), testing::Not(HasSubstr("underflow")));
  const auto& device = r.header.device;
  EXPECT_EQ(device["format"], "aixACCT TF Analyzer");
  EXPECT_EQ(device["table"], 2);
  EXPECT_THAT(device["header"].dump(), HasSubstr("Averages: 1"));
  EXPECT_TRUE(std::ranges::any_of(r.events, [](const Event& e) { return e.kind == "flag"; }));
}

TEST(Imports, OfSeveralLoopsTheOneRunInOneGo) {
  const auto tables = import(imports::aixacct_hysteresis(1));
  ASSERT_EQ(tables.size(), 1u);
  EXPECT_THAT(said(tables[0], "note"),
              HasSubstr("P1 is taken, with V+; P2 is joined from the halves of two runs; "
                        "P3 is another run, which goes along"));
  const auto& r = tables[0].recording;
  for (const auto* name : {"current", "v_minus", "i2", "p2", "i3", "p3"})
    EXPECT_NE(other(r, name), nullptr) << name;
  EXPECT_THAT(r.header.device["header"].dump(), HasSubstr("TFAnalyzer \xc2\xa9"));
}

TEST(Imports, AnAreaThatIsNotTheHeadersIsTold) {
  const auto tables = import(imports::aixacct_piezo(1, {.area_in_header = 1.1}));
  EXPECT_THAT(said(tables[0], "warning"), HasSubstr("is 5e-05 m^2 by the current"));
  EXPECT_THAT(said(tables[0], "warning"), HasSubstr("by the tester's Cls and Epsls"));
}

// The tester divided by the area in its header: whoever knows a better one changes the specimen, not what
// flowed.
TEST(Imports, AnAreaThatIsGivenLeavesTheChargeAsMeasured) {
  for (const auto& text :
       {imports::aixacct_piezo(1), imports::radiant_hysteresis(), imports::aixacct_leakage()}) {
    auto given = of(text);
    const auto stated = import_tables(given, std::nullopt)[0].recording;
    given.area = 2 * stated.header.specimen.area;
    const auto tables = import_tables(given, std::nullopt);
    const auto& r = tables[0].recording;
    EXPECT_DOUBLE_EQ(r.header.specimen.area, 2 * stated.header.specimen.area);
    EXPECT_EQ(r.has(Channel::charge), stated.has(Channel::charge));
    if (r.has(Channel::charge)) {
      EXPECT_EQ(r.at(Channel::charge), stated.at(Channel::charge));
    }
    if (const auto* current = other(stated, "current")) {
      EXPECT_EQ(*other(r, "current"), *current);
    }
    EXPECT_THAT(said(tables[0], "warning"), HasSubstr("m^2 as given; the file says"));
    EXPECT_THAT(said(tables[0], "warning"), testing::Not(HasSubstr("by the current")));
  }
}

TEST(Imports, LayersThatTheCurrentDoesNotKnowAreNotCounted) {
  const auto tables = import(imports::aixacct_pulses({.layers = 7}));
  EXPECT_EQ(tables[0].recording.header.specimen.layer_count, 1);
  EXPECT_NEAR(tables[0].recording.header.specimen.length, 200e-9, 1e-15);
  EXPECT_THAT(said(tables[0], "warning"), HasSubstr("7 layers"));
}

// A sine of current, its charge over the area of `layers` layers as the polarization, and an offset of the
// current of 1 %.
std::string stack(int layers, double factor = 1) {
  constexpr double area = 25e-6, step = 0.01;
  std::string out = "time [s],field [V],current [A],polarization [C/m^2],displacement [um]\n";
  const auto current = [](int i) { return 1e-6 * std::cos(2 * M_PI * step * i); };
  double charge = 0;
  for (int i = 0; i <= 500; ++i) {
    if (i > 0) charge += 0.5 * step * (current(i) + current(i - 1));
    for (const double v : {step * i, 100 * std::sin(2 * M_PI * step * i), current(i) + 1e-8,
                           factor * charge / (area * layers)})
      out += number_text(v) + ",";
    out += "1\n";
  }
  return out;
}

TEST(Imports, LayersAreKeptBesideAnOffsetAndWhereTheyAreGiven) {
  auto given = of("");
  given.area = 25e-6, given.layer_thickness = 1e-4, given.length = 0.03, given.layer_count = 10;
  const auto imported = [&given](std::string text) {
    given.csv = std::move(text);
    return import_tables(given, std::nullopt)[0];
  };
  const auto charge = [](const Imported& i) { return std::ranges::max(i.recording.at(Channel::charge)); };
  constexpr double flowed = 1e-6 / (2 * M_PI);
  for (const int layers : {10, 1}) {
    const auto table = imported(stack(layers));
    EXPECT_EQ(table.recording.header.specimen.layer_count, 10);
    EXPECT_EQ(table.recording.header.specimen.length, 0.03);
    EXPECT_NEAR(charge(table), flowed, 0.01 * flowed);
    EXPECT_EQ(said(table, "warning").find("10 layers are given") == std::string::npos, layers == 10);
    EXPECT_THAT(said(table, "warning"), testing::Not(HasSubstr("header")));
  }
  const auto neither = imported(stack(10, 3));
  EXPECT_EQ(neither.recording.header.specimen.layer_count, 10);
  EXPECT_NEAR(charge(neither), 3 * flowed, 0.03 * flowed);
  EXPECT_THAT(said(neither, "warning"), HasSubstr("neither with these nor with one"));
  auto header = of(imports::aixacct_pulses({.layers = 7}));
  header.length = 1e-6;
  const auto specimen = import_tables(header, std::nullopt)[0].recording.header.specimen;
  EXPECT_EQ(specimen.layer_count, 1);
  EXPECT_EQ(specimen.length, 1e-6);
}

TEST(Imports, PulsesFollowEachOther) {
  const auto tables = import(imports::aixacct_pulses());
  ASSERT_EQ(tables.size(), 1u);
  const auto& r = tables[0].recording;
  EXPECT_EQ(r.size(), 5u * 201u);
  EXPECT_THAT(said(tables[0], "pulse"), HasSubstr("pulse 2 of 5, after 0.99 s without samples"));
  EXPECT_THAT(said(tables[0], "check"), HasSubstr("A dP against the integral of I dt"));
  const auto report = render(make_report(r), Format::text);
  EXPECT_THAT(report, HasSubstr("Pulses (PUND)"));
  EXPECT_THAT(report, HasSubstr("not switching"));
}

TEST(Imports, LeakageHasACurrentAndNoCharge) {
  for (const auto& text : {imports::aixacct_leakage(), imports::radiant_leakage()}) {
    const auto tables = import(text);
    ASSERT_EQ(tables.size(), 1u);
    const auto& r = tables[0].recording;
    EXPECT_FALSE(r.has(Channel::charge));
    ASSERT_NE(other(r, "current"), nullptr);
    EXPECT_THAT(render(make_report(r), Format::text), HasSubstr("resistivity [Ω m]"));
  }
  const auto stepped = import(imports::aixacct_leakage());
  EXPECT_DOUBLE_EQ(stepped[0].recording.time.front(), 2);  // at the end of the first step
  EXPECT_NEAR((*other(stepped[0].recording, "current"))[9], 0.02e-2 * std::sinh(4.5) * 1e-8, 1e-14);
  EXPECT_THAT(said(import(imports::radiant_leakage())[0], "check"), HasSubstr("so area and thickness"));
}

TEST(Imports, FatigueHasItsReadingsInOrderAndTheLoopsBetween) {
  const auto tables = import(imports::aixacct_fatigue());
  ASSERT_EQ(tables.size(), 3u);
  const auto& r = tables[0].recording;
  EXPECT_THAT(r.time, ElementsAre(1e-4, 1e-3, 0.1, 10));
  EXPECT_NEAR(r.at(Channel::command)[0], 4.5 / 200e-9, 1);
  ASSERT_NE(other(r, "cycles"), nullptr);
  EXPECT_NEAR((*other(r, "1_dhm_pr_plus"))[3], 0.16, 1e-12);
  EXPECT_THAT(render(make_report(r), Format::text), HasSubstr("Fatigue"));
  EXPECT_TRUE(tables[1].recording.has(Channel::charge));
}

TEST(Imports, VisionsLoopsInEitherCoding) {
  const auto loop = import(imports::radiant_hysteresis());
  ASSERT_EQ(loop.size(), 1u);
  EXPECT_NEAR(loop[0].recording.header.specimen.layer_thickness, 200e-9, 1e-15);
  EXPECT_THAT(said(loop[0], "check"), HasSubstr("PMax"));
  EXPECT_THAT(said(loop[0], "check"), HasSubstr("so the thickness"));
  EXPECT_THAT(loop[0].recording.header.device["header"].dump(), HasSubstr("Sample Thickness (\xc2\xb5m)"));
  const auto remanent = import(imports::radiant_remanent());
  EXPECT_NE(other(remanent[0].recording, "logic_0_polarization"), nullptr);
  EXPECT_THAT(said(remanent[0], "note"), HasSubstr("Logic 1"));
}

TEST(Imports, EasyExpertSaysWhichChannelIsWhat) {
  EXPECT_THAT(refusal(of(imports::easyexpert())), HasSubstr("/area_m2: is missing"));
  const auto tables = import_tables(of_film(imports::easyexpert()), std::nullopt);
  ASSERT_EQ(tables.size(), 2u);
  const auto& r = tables[0].recording;
  EXPECT_NEAR(r.at(Channel::field)[50], 3 / 200e-9, 1);
  const auto& q = r.at(Channel::charge);
  EXPECT_GT(q[60], q[0]);  // the other channel's current, turned
  EXPECT_EQ(r.header.charge_reference, ChargeReference::first_sample);
  EXPECT_THAT(said(tables[0], "check"), HasSubstr("the times of all channels"));
  EXPECT_THAT(said(tables[1], "warning"), HasSubstr("the same rows as table 1"));
}

// A map that names the record's columns need not repeat their units; the sign is turned where the column is
// not named, and the note says so.
TEST(Imports, EasyExpertsUnitsHoldUnderAMap) {
  auto given = of_film(imports::easyexpert());
  const auto by_itself = import_tables(given, std::nullopt)[0];
  const auto flowed = by_itself.recording.at(Channel::charge)[60];
  EXPECT_THAT(said(by_itself, "note"), HasSubstr("its sign is turned"));
  given.current = ColumnMap{.scale = -1};
  const auto turned = import_tables(given, std::nullopt)[0];
  EXPECT_DOUBLE_EQ(turned.recording.at(Channel::charge)[60], -flowed);
  EXPECT_THAT(said(turned, "warning"), HasSubstr("runs against the field"));
  given.field = ColumnMap{.column = "MeasResult1_value"};
  given.current = ColumnMap{.column = "MeasResult2_value"};
  const auto named = import_tables(given, std::nullopt)[0];
  EXPECT_NEAR(named.recording.at(Channel::field)[50], 3 / 200e-9, 1);
  EXPECT_DOUBLE_EQ(named.recording.at(Channel::charge)[60], -flowed);
  EXPECT_THAT(said(named, "note"), testing::Not(HasSubstr("turned")));
  given.field->scale = -1;
  EXPECT_THAT(refusal(given), HasSubstr("/field/scale"));
}

TEST(Imports, BareRowsMustBeToldAndTheSignIsChecked) {
  auto given = of_film(imports::data_values());
  const auto message = refusal(given);
  EXPECT_THAT(message, HasSubstr("column 2 rises from 0 to"));
  EXPECT_THAT(message, HasSubstr("column 1 holds"));
  given.time = ColumnMap{.number = 2};
  given.current = ColumnMap{.number = 3, .unit = "A"};
  given.field = ColumnMap{.number = 4, .unit = "V"};
  const auto right = import_tables(given, std::nullopt);
  EXPECT_EQ(said(right[0], "warning"), "");
  given.current->scale = -1;
  EXPECT_THAT(said(import_tables(given, std::nullopt)[0], "warning"), HasSubstr("runs against the field"));
}

TEST(Imports, ADecimalCommaIsReadAndAMixtureRefused) {
  const auto points = import(imports::aixacct_piezo(2));
  const auto commas = import(imports::aixacct_piezo(2, {.decimal_comma = true}));
  ASSERT_EQ(commas.size(), 2u);
  EXPECT_EQ(commas[1].recording.at(Channel::field), points[1].recording.at(Channel::field));
  auto mixed = imports::aixacct_piezo(1);
  const auto at = mixed.find('.', mixed.find("CH3 [V]") + 500);
  mixed[at] = ',';
  EXPECT_THAT(refusal(of(mixed)), HasSubstr("the decimal mark of this file is '.'"));
}

TEST(Imports, AMetersOverloadIsAGap) {
  for (auto [text, from] : {std::pair{imports::aixacct_piezo(1), "CH3 [V]\t\n"},
                            std::pair{imports::easyexpert(), "MeasResult2_time\n"}}) {
    // The current is the fourth column of an aixACCT row and the third one of a B1500's.
    const bool tester = text.starts_with("Piezo");
    const char delimiter = tester ? '\t' : ',';
    auto begin = text.find(from) + std::string_view(from).size();
    for (int line = 0; line < 50; ++line) begin = text.find('\n', begin) + 1;
    for (int cell = 0; cell < (tester ? 3 : 2); ++cell) begin = text.find(delimiter, begin) + 1;
    text.replace(begin, text.find(delimiter, begin) - begin, "9.91E+37");
    const auto table = import_tables(tester ? of(text) : of_film(text), std::nullopt)[0];
    EXPECT_TRUE(std::isnan((*other(table.recording, "current"))[50]));
    EXPECT_THAT(said(table, "warning"), HasSubstr("one cell marks an overload of the meter by 9.91E+37"));
  }
}

TEST(Imports, DamageIsRefusedWithItsLine) {
  const auto piezo = imports::aixacct_piezo(2);
  EXPECT_THAT(refusal(of(piezo.substr(0, piezo.size() - 40))), HasSubstr("not 13 as the heading says"));
  EXPECT_THAT(refusal(of(replaced(piezo, "V+ [V]\tV-", "V+ [furlong]\tV-"))),
              HasSubstr("has a unit that is not understood here"));
  EXPECT_THAT(refusal(of(replaced(piezo, "Area [mm2]", "Area [acre]"))), HasSubstr("line "));
  EXPECT_THAT(refusal(of(replaced(imports::radiant_hysteresis(), "Points:\t201", "Points:\t211"))),
              HasSubstr("211 points, and there are 201"));
  EXPECT_THAT(refusal(of_film(replaced(imports::easyexpert(), "Dimension1, 201", "Dimension1, 210"))),
              HasSubstr("Dimension1 says 210"));
  EXPECT_THAT(refusal(of("\xff\xfe"
                         "P\0i\0")),
              HasSubstr("UTF-16"));
  EXPECT_THAT(refusal(of(replaced(piezo, "Averages: 1", "Averages \x1b[31m"))), HasSubstr("line "));
}

TEST(Imports, LinesThatASpreadsheetPaddedAreRead) {
  for (const auto& text : {imports::aixacct_piezo(2), imports::radiant_hysteresis()}) {
    std::string padded;
    for (const char c : text) {
      if (c == '\n') padded.insert(padded.size() - (padded.ends_with('\r') ? 1 : 0), 3, '\t');
      padded += c;
    }
    const auto tables = import(padded), plain = import(text);
    ASSERT_EQ(tables.size(), plain.size());
    EXPECT_EQ(tables[0].recording.at(Channel::charge), plain[0].recording.at(Channel::charge));
  }
}

TEST(Imports, AHeaderThatIsWrongIsNotReadWhereTheUserKnowsBetter) {
  auto given = of(replaced(imports::aixacct_piezo(1), "Area [mm2]: ", "Area [mm2]: -"));
  EXPECT_THAT(refusal(given), HasSubstr("Area is below zero"));
  given.area = 50e-6;
  EXPECT_EQ(import_tables(given, std::nullopt)[0].recording.header.specimen.area, 50e-6);
}

TEST(Imports, WhatTheUserSaysWins) {
  auto given = of(imports::aixacct_hysteresis(1));
  given.layer_thickness = 100e-9;
  const auto tables = import_tables(given, std::nullopt);
  EXPECT_DOUBLE_EQ(tables[0].recording.header.specimen.layer_thickness, 100e-9);
  EXPECT_THAT(said(tables[0], "warning"), HasSubstr("is 1e-07 m as given; the file says 2e-07 m"));
  given.field = ColumnMap{.number = 2};
  EXPECT_THAT(refusal(given), HasSubstr("/field: has no meaning"));
}

TEST(Imports, AllOfItIsInTheFile) {
  const auto tables = import(imports::aixacct_hysteresis(1));
  const auto path = std::filesystem::temp_directory_path() / ("imports-" + std::to_string(getpid()) + ".h5");
  write_recording(path.string(), tables[0].recording);
  change_recording(path.string(), [](Recording& r) { r.events.push_back({0, "note", "looked at"}); });
  const auto back = read_recording(path.string());
  std::filesystem::remove(path);
  ASSERT_EQ(back.others.size(), tables[0].recording.others.size());
  for (std::size_t i = 0; i < back.others.size(); ++i) {
    EXPECT_EQ(back.others[i].as.name, tables[0].recording.others[i].as.name);
    EXPECT_EQ(back.others[i].as.unit, tables[0].recording.others[i].as.unit);
    EXPECT_EQ(back.others[i].values, tables[0].recording.others[i].values);
  }
  EXPECT_EQ(back.header.device["findings"], tables[0].recording.header.device["findings"]);
}

// The real ones may not be shipped; where they lie beside the source, all of them are read.
TEST(Imports, RealFiles) {
  const auto folder = std::filesystem::path(FERROBENCH_SOURCE).parent_path() / "shared" / "data" / "measured";
  struct Expected {
    const char* file;
    std::size_t tables, rows;
    bool film;
  };
  for (const auto& [file, count, rows, film] :
       {Expected{"aixacct_piezo_loops.dat", 10, 401, false},
        Expected{"aixacct_dynamic_hysteresis.dat", 10, 401, false},
        Expected{"aixacct_pund.dat", 2, 2005, false}, Expected{"aixacct_tfa3000_pund.dat", 1, 2005, false},
        Expected{"radiant_hysteresis.txt", 1, 501, false}, Expected{"radiant_leakage.txt", 1, 510, false},
        Expected{"b1500_forc.csv", 2, 5000, true}, Expected{"b1500_pund.csv", 2, 1000, true},
        Expected{"feplot_pund.csv", 1, 5000, true}, Expected{"feplot_endurance.csv", 1, 500, true}}) {
    const auto path = folder / file;
    if (!std::filesystem::exists(path)) GTEST_SKIP() << "there is no " << path;
    auto given = film ? of_film("") : of("");
    given.csv = read_text_file(path.string(), 1u << 24, ErrorCode::bad_recording);
    if (std::string_view(file).starts_with("feplot")) {
      given.time = ColumnMap{.number = 2};
      given.current = ColumnMap{.number = 3, .unit = "A"};
      given.field = ColumnMap{.number = 4, .unit = "V"};
    }
    const auto tables = import_tables(given, std::nullopt);
    ASSERT_EQ(tables.size(), count) << file;
    for (const auto& table : tables) {
      EXPECT_EQ(table.recording.size(), rows) << file;
      EXPECT_FALSE(render(make_report(table.recording), Format::text).empty());
    }
    if (std::string_view(file) == "aixacct_piezo_loops.dat") {
      EXPECT_THAT(said(tables[0], "warning"), HasSubstr("72.4 V above"));
      EXPECT_THAT(said(tables[0], "check"), HasSubstr("so the area of 6e-05 m^2 holds"));
      EXPECT_THAT(said(tables[6], "flag"), HasSubstr("underflow"));
    }
  }
}

}  // namespace
}  // namespace ferrobench::recordings

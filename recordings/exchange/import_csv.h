// A table of samples in text as a recording. The other way is export.h.
//
// The text is read as base/delimited_text.h has it. A channel's column is the one given, else the one whose
// heading names the channel (base/headings.h). Where its unit is not given it is that of its heading, and SI
// where that says none; one that is not understood is refused, and so is a voltage without a unit. Other
// columns with a heading go along.
#pragma once

#include <map>
#include <span>
#include <string>
#include <utility>

#include "base/fields.h"
#include "base/load_range.h"
#include "recordings/exchange/conversion/recording_of.h"

namespace ferrobench::recordings {

// Where a channel stands: SI value = offset + scale * unit * what is written there.
struct ColumnMap {
  std::string column{};                  // its name in the first row
  std::optional<std::int64_t> number{};  // or its number, from 1
  std::string unit{};                    // "": that of the heading, unless there is a scale
  std::optional<double> scale{};
  double offset = 0;
  bool names_a_column() const { return number || !column.empty(); }
};
template <class Visitor>
void describe(Visitor& visit, ColumnMap& m) {
  visit("column", m.column, {.doc = "name in the first row"});
  visit("number", m.number, {.min = 1, .doc = "of the column, from 1, in place of its name"});
  visit("unit", m.unit,
        {.doc = "of what is written: kV/mm, um, ...; absent: as the heading says, unless there is a scale; "
                "else SI"});
  visit("scale", m.scale,
        {.doc = "units in one that is written; without a unit: SI units, unless the heading says a unit"});
  visit("offset", m.offset, {.doc = "added after scaling, in SI"});
}

enum class Delimiter { comma, semicolon, tab, space };
std::span<const std::pair<Delimiter, std::string_view>> enum_names(Delimiter);

struct CsvImport {
  std::string csv{}, title{}, source{};
  std::optional<Delimiter> delimiter{};
  std::optional<bool> decimal_comma{}, header{};
  // Absent: the columns that are named time, command, field, charge, displacement, force, ...
  std::optional<ColumnMap> time{}, command{}, field{}, charge{}, displacement{}, force{};
  std::optional<ColumnMap> current{}, polarization{};  // what a charge follows from
  std::optional<double> sample_rate{};                 // in place of time, Hz
  std::string specimen{};
  std::optional<double> length{}, area{}, layer_thickness{};
  std::optional<std::int64_t> layer_count{};
  double spring_stiffness = 0, prestress = 0;
  bool charge_is_absolute = false;
};
template <class Visitor>
void describe(Visitor& visit, CsvImport& i) {
  constexpr FieldInfo optional_column{.doc = "column of this channel, if it was measured; absent: named so"};
  visit("csv", i.csv, {.required = true, .doc = "the text: a table, or what a tester wrote"});
  visit(
      "length_m", i.length,
      {.unit = "m",
       .min = 0,
       .exclusive_min = true,
       .doc = "of the stack; absent, where no displacement was measured or a tester's file says the layers: "
              "that of its layers"});
  visit("area_m2", i.area,
        {.unit = "m^2",
         .min = 0,
         .exclusive_min = true,
         .doc = "of one layer's electrode; needed unless the file says it"});
  visit("layer_thickness_m", i.layer_thickness,
        {.unit = "m",
         .min = 0,
         .exclusive_min = true,
         .doc = "turns a voltage into a field; needed unless the file says it"});
  visit("title", i.title, {.doc = "of the recording"});
  visit("source", i.source, {.doc = "where it comes from; kept in the recording"});
  visit("delimiter", i.delimiter, {.doc = "between cells; a space is any white space; absent: found"});
  visit("decimal_comma", i.decimal_comma, {.doc = "1,5 is one and a half; absent: found"});
  visit("header", i.header, {.doc = "whether the first row holds names; absent: found"});
  visit("time", i.time,
        {.unit = "s", .doc = "column of the time; absent, as for each channel: the one that is named so"});
  visit("sample_rate_Hz", i.sample_rate,
        {.unit = "Hz", .min = 0, .exclusive_min = true, .doc = "in place of a column of the time"});
  visit("command", i.command, optional_column);
  visit("field", i.field, optional_column);
  visit("charge", i.charge, optional_column);
  visit("displacement", i.displacement, optional_column);
  visit("force", i.force, optional_column);
  visit("specimen", i.specimen, {.doc = "name"});
  visit("layer_count", i.layer_count,
        {.min = 1, .doc = "layers of the stack; absent: as the file says, or 1"});
  visit("spring_stiffness_N_per_m", i.spring_stiffness,
        {.unit = "N/m", .min = 0, .doc = "of the spring that it works against; 0: none"});
  visit("prestress_Pa", i.prestress,
        {.unit = "Pa",
         .min = prestress_min,
         .max = prestress_max,
         .doc = "that it is under; compression positive"});
  visit("charge_is_absolute", i.charge_is_absolute, {.doc = "false: its zero is the first sample"});
  visit("current", i.current,
        {.doc = "column of the current, if it was measured; without charge and polarization its integral is "
                "the charge"});
  visit("polarization", i.polarization, {.doc = "column of the polarization, in place of the charge"});
}

// What the user says of the specimen and the load.
KnownSpecimen given_specimen(const CsvImport& import);
Identity identity_of(const CsvImport& import);

// What the file says of a table in it.
struct TableInFile {
  std::size_t first_line = 1;  // of the table's text
  Findings findings{};         // so far
  nlohmann::json device = nlohmann::json::object();
  // Of columns, by their names: a tester's, which has only channels.
  std::map<std::string, std::string> units{};
};

// The table alone; what is found goes into the recording, too. Throws Error(bad_recording) with the lines and
// columns that are wrong.
Imported import_csv_table(const CsvImport& import, TableInFile file, const Progress& progress = nullptr);
Recording import_csv(const CsvImport& import);

}  // namespace ferrobench::recordings

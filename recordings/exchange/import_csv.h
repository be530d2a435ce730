// A table of samples in text as a recording. The other way is export.h.
//
// The text is read as base/delimited_text.h has it. Where a column's unit is not given it is that
// of its heading (base/headings.h), and SI where that says none; one that is not understood is
// refused.
#pragma once

#include <span>
#include <string>
#include <utility>

#include "base/fields.h"
#include "recordings/format/recording.h"

namespace ferrobench::recordings {

// Where a channel stands: SI value = offset + scale * unit * what is written there.
struct ColumnMap {
  std::string column{};                  // its name in the first row
  std::optional<std::int64_t> number{};  // or its number, from 1
  std::string unit{};                    // "": that of the heading, unless there is a scale
  std::optional<double> scale{};
  double offset = 0;
};
template <class Visitor>
void describe(Visitor& visit, ColumnMap& m) {
  visit("column", m.column, {.doc = "name in the first row"});
  visit("number", m.number, {.min = 1, .doc = "of the column, from 1, in place of its name"});
  visit("unit", m.unit,
        {.doc = "of what is written: kV/mm, um, ...; absent: as the heading says, unless there is a scale; "
                "else SI"});
  visit("scale", m.scale, {.doc = "units in one that is written; without a unit: SI units"});
  visit("offset", m.offset, {.doc = "added after scaling, in SI"});
}

enum class Delimiter { comma, semicolon, tab, space };
std::span<const std::pair<Delimiter, std::string_view>> enum_names(Delimiter);

struct CsvImport {
  std::string csv{}, title{}, source{};
  std::optional<Delimiter> delimiter{};
  std::optional<bool> decimal_comma{}, header{};
  // None of these: the columns that are named time, command, field, charge, displacement, force.
  std::optional<ColumnMap> time{}, command{}, field{}, charge{}, displacement{}, force{};
  std::optional<double> sample_rate{};  // in place of time, Hz
  std::string specimen{};
  double length = 0, area = 0, layer_thickness = 0;
  std::int64_t layer_count = 1;
  double spring_stiffness = 0, prestress = 0;
  bool charge_is_absolute = false;
};
template <class Visitor>
void describe(Visitor& visit, CsvImport& i) {
  constexpr FieldInfo optional_column{.doc = "column of this channel, if it was measured"};
  visit("csv", i.csv, {.required = true, .doc = "the text: a row of names, if there are any, then numbers"});
  visit("title", i.title, {.doc = "of the recording"});
  visit("source", i.source, {.doc = "where it comes from; kept in the recording"});
  visit("delimiter", i.delimiter, {.doc = "between cells; a space is any white space; absent: found"});
  visit("decimal_comma", i.decimal_comma, {.doc = "1,5 is one and a half; absent: found"});
  visit("header", i.header, {.doc = "whether the first row holds names; absent: found"});
  visit("time", i.time,
        {.unit = "s", .doc = "column of the time; absent, with no other column: by their names"});
  visit("sample_rate_Hz", i.sample_rate,
        {.unit = "Hz", .min = 0, .exclusive_min = true, .doc = "in place of a column of the time"});
  visit("command", i.command, optional_column);
  visit("field", i.field, optional_column);
  visit("charge", i.charge, optional_column);
  visit("displacement", i.displacement, optional_column);
  visit("force", i.force, optional_column);
  visit("specimen", i.specimen, {.doc = "name"});
  visit("length_m", i.length,
        {.unit = "m", .min = 0, .exclusive_min = true, .required = true, .doc = "of the stack"});
  visit(
      "area_m2", i.area,
      {.unit = "m^2", .min = 0, .exclusive_min = true, .required = true, .doc = "of one layer's electrode"});
  visit("layer_thickness_m", i.layer_thickness,
        {.unit = "m",
         .min = 0,
         .exclusive_min = true,
         .required = true,
         .doc = "turns a voltage into a field"});
  visit("layer_count", i.layer_count, {.min = 1, .doc = "layers of the stack"});
  visit("spring_stiffness_N_per_m", i.spring_stiffness,
        {.unit = "N/m", .min = 0, .doc = "of the spring that it works against; 0: none"});
  visit("prestress_Pa", i.prestress, {.unit = "Pa", .doc = "that it is under"});
  visit("charge_is_absolute", i.charge_is_absolute, {.doc = "false: its zero is the first sample"});
}

// Throws Error(bad_recording) with the lines and columns that are wrong.
Recording import_csv(const CsvImport& import);

}  // namespace ferrobench::recordings

// A table of samples, written as text, as a recording. The other way is recordings/export.h.
#pragma once

#include <string>

#include "protocols/common/fields.h"
#include "recordings/recording.h"

namespace ferrobench::server {

// Where a channel stands in a CSV file: SI value = offset + scale * what is written there.
struct ColumnMap {
  std::string column{};  // its name in the first line
  double scale = 1, offset = 0;
};
template <class Visitor>
void describe(Visitor& visit, ColumnMap& m) {
  visit("column", m.column, {.required = true, .doc = "name in the first line of the CSV"});
  visit("scale", m.scale, {.doc = "SI units in one unit of the column"});
  visit("offset", m.offset, {.doc = "added after scaling, in SI"});
}

struct CsvImport {
  std::string csv{}, title{}, source{};
  ColumnMap time{};
  std::optional<ColumnMap> command{}, field{}, charge{}, displacement{}, force{};
  std::string specimen{};
  double length = 0, area = 0, layer_thickness = 0;
  std::int64_t layer_count = 1;
  double spring_stiffness = 0, prestress = 0;
  bool charge_is_absolute = false;
};
template <class Visitor>
void describe(Visitor& visit, CsvImport& i) {
  constexpr FieldInfo optional_column{.doc = "column of this channel, if it was measured"};
  visit("csv", i.csv, {.required = true, .doc = "the text: a line of names, then numbers"});
  visit("title", i.title, {});
  visit("source", i.source, {.doc = "where it comes from; kept in the recording"});
  visit("time", i.time, {.unit = "s", .required = true});
  visit("command", i.command, optional_column);
  visit("field", i.field, optional_column);
  visit("charge", i.charge, optional_column);
  visit("displacement", i.displacement, optional_column);
  visit("force", i.force, optional_column);
  visit("specimen", i.specimen, {.doc = "name"});
  visit("length_m", i.length, {.unit = "m", .min = 0, .exclusive_min = true, .required = true});
  visit("area_m2", i.area, {.unit = "m^2", .min = 0, .exclusive_min = true, .required = true});
  visit("layer_thickness_m", i.layer_thickness,
        {.unit = "m", .min = 0, .exclusive_min = true, .required = true});
  visit("layer_count", i.layer_count, {.min = 1});
  visit("spring_stiffness_N_per_m", i.spring_stiffness, {.unit = "N/m", .min = 0});
  visit("prestress_Pa", i.prestress, {.unit = "Pa"});
  visit("charge_is_absolute", i.charge_is_absolute, {.doc = "false: its zero is the first sample"});
}
// Throws Error(bad_recording) with the lines and columns that are wrong.
recordings::Recording read_csv(const CsvImport& import);

}  // namespace ferrobench::server

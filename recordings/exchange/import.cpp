#include "recordings/exchange/import.h"

#include "base/number_text.h"
#include "recordings/exchange/conversion/columns.h"
#include "recordings/exchange/testers/aixacct.h"
#include "recordings/exchange/testers/easyexpert.h"
#include "recordings/exchange/testers/lines.h"
#include "recordings/exchange/testers/radiant.h"

namespace ferrobench::recordings {
namespace {

using nlohmann::json;

json texts_of(const std::vector<HeaderLine>& lines) {
  auto out = json::array();
  for (const auto& line : lines) out.push_back(line.text);
  return out;
}

// A recording says which of how many tables it is, and where in the file.
json device_of(std::string_view kind, std::size_t table, std::size_t tables) {
  return {{"format", kind}, {"table", table}, {"tables", tables}};
}

std::string title_of(const TesterTable& table, const KnownSpecimen& stated) {
  std::string out = stated.name.empty() ? "" : stated.name + ", ";
  out += table.measurement + ", " + table.label;
  for (const std::string_view key :
       {"Hysteresis Amplitude", "Pund Amplitude", "Volts", "Hysteresis Frequency", "Pund Frequency",
        "Hysteresis Period", "Total Cycles"})
    if (const auto value = table.find(key); value && value->number) {
      out += ", " + number_text(*value->number);
      out += key == "Volts" ? " V" : key == "Total Cycles" ? " cycles" : " " + value->unit;
    }
  return out;
}

// A tester says which columns it has; to be told others would be a contradiction.
void demand_no_columns(const CsvImport& import, SourceKind kind) {
  std::vector<Problem> problems;
  const auto refuse = [&](const char* path, bool given) {
    if (given)
      problems.push_back(
          {.path = path,
           .message = "has no meaning: " + std::string(what_it_is(kind)) + " says what its columns are"});
  };
  refuse("/time", import.time.has_value());
  refuse("/command", import.command.has_value());
  refuse("/field", import.field.has_value());
  refuse("/charge", import.charge.has_value());
  refuse("/displacement", import.displacement.has_value());
  refuse("/force", import.force.has_value());
  refuse("/current", import.current.has_value());
  refuse("/polarization", import.polarization.has_value());
  refuse("/sample_rate_Hz", import.sample_rate.has_value());
  refuse("/delimiter", import.delimiter.has_value());
  refuse("/decimal_comma", import.decimal_comma.has_value());
  refuse("/header", import.header.has_value());
  if (!problems.empty())
    throw Error(ErrorCode::invalid_params, "the columns cannot be told", std::move(problems));
}

std::vector<Imported> of_tester(const CsvImport& import, SourceKind kind, std::vector<TesterTable> tables) {
  demand_no_columns(import, kind);
  std::vector<Imported> out;
  for (auto& table : tables) {
    auto device = device_of(table.tester, out.size() + 1, tables.size());
    device["measurement"] = table.measurement;
    device["label"] = table.label;
    device["file_header"] = texts_of(table.file_header);
    device["header"] = texts_of(table.header);
    if (!table.figures.empty()) device["figures"] = table.figures;
    auto columns = json::array();
    for (const auto& c : table.columns)
      columns.push_back(c.unit.empty() ? c.name : c.name + " [" + c.unit + "]");
    device["columns"] = std::move(columns);
    const auto stated = specimen_in_header(table, given_specimen(import));
    auto identity = identity_of(import);
    const auto own = title_of(table, stated);
    identity.title = identity.title.empty() ? own : identity.title + ": " + own;
    Findings findings;
    const auto specimen = settle_specimen(given_specimen(import), stated, false, findings);
    auto measured = measured_of(table, specimen, stated.area.value_or(specimen.area));
    measured.findings.insert(measured.findings.begin(), findings.begin(), findings.end());
    out.push_back(recording_of(std::move(measured), specimen, identity, std::move(device)));
    table = {};
  }
  return out;
}

// Of a text that has neither a count of rows nor an end of its own.
void look_at_the_end(std::string_view text, Findings& findings) {
  if (text.find('\n') != std::string_view::npos && !text.ends_with('\n'))
    findings.push_back(
        {"warning", "the last line has no end, as the others have: whether it is whole cannot be told"});
}

// The column of a record's is taken where the map names none.
void fill(std::optional<ColumnMap>& map, const std::string& column) {
  if (column.empty() || (map && map->names_a_column())) return;
  if (!map) map.emplace();
  map->column = column;
}

CsvImport with_columns(const CsvImport& import, const EasyExpertRecord& record) {
  auto out = import;
  out.csv = std::string(record.rows);
  out.delimiter = Delimiter::comma;
  out.header = record.named;
  if (!import.sample_rate) fill(out.time, record.time);
  if (!import.command) fill(out.field, record.voltage);
  fill(out.current, record.current);
  return out;
}

// What flows out of a channel counts as positive there: through the specimen it flows into that one. A column
// that the user names is taken as it is written.
void turn_current(CsvImport& out, const CsvImport& import, const EasyExpertRecord& record,
                  Findings& findings) {
  if (record.voltage.empty() || record.current.empty()) return;
  const bool turned = !(import.current && import.current->names_a_column());
  if (turned) {
    out.current->scale = -out.current->scale.value_or(1);
    if (out.current->unit.empty()) out.current->unit = "A";
  }
  findings.push_back(
      {"note", record.voltage + " is a voltage and " + record.current +
                   " a current, by the channels' operation modes" +
                   (turned ? "; the current is that of the other channel, so its sign is turned" : "")});
}

std::vector<Imported> of_easyexpert(const CsvImport& import, SourceKind kind, const Progress& progress) {
  const auto records = read_easyexpert(import.csv);
  std::vector<Imported> out;
  for (std::size_t i = 0; i < records.size(); ++i) {
    const auto& record = records[i];
    TableInFile table{.first_line = record.first_line, .findings = record.findings};
    auto& findings = table.findings;
    auto given = with_columns(import, record);
    turn_current(given, import, record, findings);
    if (!record.named) look_at_the_end(import.csv, findings);
    for (std::size_t k = 0; k < i; ++k)
      if (records[k].rows == record.rows)
        findings.push_back({"warning", "it has the same rows as table " + std::to_string(k + 1) +
                                           " of the file, value by value: one measurement, shown twice"});
    table.device = device_of(kind == SourceKind::easyexpert ? "Keysight EasyEXPERT" : "DataValue rows", i + 1,
                             records.size());
    table.device["header"] = texts_of(record.header);
    for (const auto& [column, unit] :
         {std::pair{record.time, "s"}, std::pair{record.voltage, "V"}, std::pair{record.current, "A"}})
      if (!column.empty()) table.units[column] = unit;
    for (const auto& line : record.header)
      if (line.text.starts_with("SetupTitle,"))
        given.title += (given.title.empty() ? "" : ": ") +
                       std::string(trimmed(std::string_view(line.text).substr(line.text.find(',') + 1)));
    const auto shown = [&](double share) {
      if (progress) progress((static_cast<double>(i) + share) / static_cast<double>(records.size()));
    };
    out.push_back(import_csv_table(given, std::move(table), shown));
  }
  return out;
}

}  // namespace

std::string table_suffix(std::size_t number) {
  return (number < 10 ? "-table-0" : "-table-") + std::to_string(number);
}

std::vector<Imported> import_tables(const CsvImport& import, std::optional<SourceKind> kind,
                                    const Progress& progress) {
  const auto which = kind ? *kind : detect_kind(import.csv);
  std::vector<Imported> out;
  switch (which) {
    case SourceKind::aixacct:
      out = of_tester(import, which, read_aixacct(import.csv, progress));
      break;
    case SourceKind::radiant:
      out = of_tester(import, which, read_radiant(import.csv, progress));
      break;
    case SourceKind::easyexpert:
    case SourceKind::data_values:
      out = of_easyexpert(import, which, progress);
      break;
    case SourceKind::csv: {
      TableInFile table{.device = device_of("table in text", 1, 1)};
      look_at_the_end(import.csv, table.findings);
      out.push_back(import_csv_table(import, std::move(table), progress));
      break;
    }
  }
  if (progress) progress(1);
  return out;
}

}  // namespace ferrobench::recordings

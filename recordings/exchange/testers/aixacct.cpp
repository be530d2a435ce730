#include "recordings/exchange/testers/aixacct.h"

#include <algorithm>
#include <array>

#include "base/fields.h"
#include "recordings/exchange/testers/lines.h"
#include "recordings/exchange/testers/number_rows.h"

namespace ferrobench::recordings {
namespace {

constexpr std::array<std::pair<std::string_view, Measurement>, 5> measurements{
    {{"Piezo", Measurement::hysteresis},
     {"DynamicHysteresis", Measurement::hysteresis},
     {"Pulse", Measurement::pulses},
     {"Leakage", Measurement::leakage_steps},
     {"Fatigue", Measurement::fatigue}}};

// "PulseResult", "Pulse": their measurement.
const std::pair<std::string_view, Measurement>* measurement_of(std::string_view line) {
  auto name = trimmed(line);
  if (name.ends_with("Result")) name.remove_suffix(6);
  const auto found = std::ranges::find(measurements, name, [](const auto& m) { return m.first; });
  return found == measurements.end() ? nullptr : &*found;
}

bool begins_a_table(std::string_view line) {
  for (const std::string_view name : {"Table ", "Result Table ", "Data Table "}) {
    if (!line.starts_with(name)) continue;
    const auto number = trimmed(line.substr(name.size()));
    return !number.empty() && number.find_first_not_of("0123456789[],. ") == std::string_view::npos;
  }
  return false;
}

class AixacctFile {
 public:
  AixacctFile(std::string_view text, const Progress& progress) : lines_(text), progress_(progress) {}

  std::vector<TesterTable> read() {
    find_measurement();
    while (lines_.next()) {
      const auto line = trimmed(lines_.text());
      if (line.empty()) continue;
      if (begins_a_table(line))
        read_table();
      else if (measurement_of(line) != nullptr)
        in_summary_ = false;
      else if (line.find(':') != std::string_view::npos || line == "Data Measurement Parameters")
        file_header_.push_back({to_utf8(line), lines_.number()});
      else
        lines_.refuse("is no part of an aixACCT file", line, "the file was changed; export it once more");
    }
    if (tables_.empty())
      lines_.refuse("the file ends here, and there was no table in it", "",
                    "the file was cut off; export it once more");
    compare_with_summary();
    return std::move(tables_);
  }

 private:
  void find_measurement() {
    while (lines_.next() && lines_.is_blank()) {
    }
    measurement_ = measurement_of(lines_.text());
    if (measurement_ == nullptr) {
      auto allowed = nlohmann::json::array();
      for (const auto& [name, kind] : measurements) allowed.push_back(name);
      lines_.refuse("does not name a measurement that is read here", lines_.text(), "", allowed);
    }
    in_summary_ = trimmed(lines_.text()).ends_with("Result");
  }

  void read_table() {
    TesterTable table{.tester = "aixACCT TF Analyzer",
                      .measurement = std::string(measurement_->first),
                      .label = to_utf8(trimmed(lines_.text())),
                      .kind = measurement_->second,
                      .file_header = {},
                      .header = {},
                      .columns = {}};
    const auto begin = lines_.number();
    const auto names_columns = [this] { return trimmed(lines_.text()).find('\t') != std::string_view::npos; };
    while (lines_.next() && !names_columns()) {
      const auto line = trimmed(lines_.text());
      if (line.find(':') == std::string_view::npos)
        lines_.refuse("should be a line of the header of " + table.label + ", or name its columns", line,
                      "the file was cut off or changed; export it once more");
      table.header.push_back({to_utf8(line), lines_.number()});
    }
    if (!names_columns())
      lines_.refuse("the file ends within the header of " + table.label, "",
                    "the file was cut off; export it once more");
    const std::string headings(lines_.text());
    read_headings(headings, table);
    NumberRows(lines_, progress_).read(table);
    if (table.rows() == 0)
      lines_.refuse(table.label + ", from line " + std::to_string(begin) + " on, has no rows", "",
                    "the file was cut off; export it once more");
    if (in_summary_ && table.header.empty()) {
      listed_ += table.rows();
      return;
    }
    if (table.label.starts_with("Data Table")) table.kind = kind_by_columns(table);
    if (table.kind == Measurement::pulses) stack_pulses(table);
    table.file_header = file_header_;
    tables_.push_back(std::move(table));
  }

  // What was measured between the cycles of a fatigue test.
  static Measurement kind_by_columns(const TesterTable& table) {
    if (table.columns.front().name != "Time") return Measurement::leakage_steps;
    const auto is_time = [](const TesterColumn& c) { return c.name == "Time"; };
    return std::ranges::count_if(table.columns, is_time) > 1 ? Measurement::pulses : Measurement::hysteresis;
  }

  void stack_pulses(TesterTable& table) {
    auto& columns = table.columns;
    const auto first = columns.front().name;
    std::size_t width = 1;
    while (width < columns.size() && columns[width].name != first) ++width;
    if (columns.size() % width != 0)
      lines_.refuse("the pulses of " + table.label + " have not the same columns",
                    std::to_string(columns.size()) + " columns");
    for (std::size_t i = width; i < columns.size(); ++i)
      if (columns[i].name != columns[i % width].name || columns[i].unit != columns[i % width].unit)
        lines_.refuse("the pulses of " + table.label + " have not the same columns", columns[i].name, "",
                      columns[i % width].name + " [" + columns[i % width].unit + "]");
    const auto rows = table.rows();
    for (std::size_t i = width; i < columns.size(); ++i) {
      if (i % width == 0) table.blocks.push_back(i / width * rows);
      auto& whole = columns[i % width].values;
      whole.insert(whole.end(), columns[i].values.begin(), columns[i].values.end());
      columns[i].values = {};
    }
    columns.resize(width);
    demand_stated(table, "Number of pulses", columns.empty() ? 0 : table.blocks.size() + 1);
    demand_stated(table, "Pulse Points", rows);
  }

  void demand_stated(const TesterTable& table, std::string_view key, std::size_t found) {
    const auto stated = table.find(key);
    if (!stated || !stated->number || *stated->number == static_cast<double>(found)) return;
    lines_.refuse(table.label + " has another number of them than line " + std::to_string(stated->line) +
                      " says (" + std::string(key) + ")",
                  std::to_string(found), "the file was cut off or changed; export it once more",
                  stated->text);
  }

  void compare_with_summary() {
    if (listed_ == 0 || listed_ == tables_.size()) return;
    for (auto& table : tables_)
      table.findings.push_back({"warning", "the file's summary lists " + std::to_string(listed_) +
                                               " tables, and " + std::to_string(tables_.size()) +
                                               " are there: it was cut off or changed"});
  }

  Lines lines_;
  const Progress& progress_;
  const std::pair<std::string_view, Measurement>* measurement_ = nullptr;
  bool in_summary_ = false;
  std::size_t listed_ = 0;  // tables, by the summary
  std::vector<HeaderLine> file_header_;
  std::vector<TesterTable> tables_;
};

}  // namespace

bool looks_like_aixacct(std::string_view text) {
  constexpr std::size_t looked_at = 4096;
  Lines lines(text.substr(0, looked_at));
  while (lines.next())
    if (!lines.is_blank()) {
      const auto first = trimmed(lines.text());
      if (measurement_of(first) != nullptr) return true;
      // A measurement that is not read here is still a file of this kind.
      return first.ends_with("Result") && first.find_first_of(" ,;\t") == std::string_view::npos;
    }
  return false;
}

std::vector<TesterTable> read_aixacct(std::string_view text, const Progress& progress) {
  return AixacctFile(text, progress).read();
}

}  // namespace ferrobench::recordings

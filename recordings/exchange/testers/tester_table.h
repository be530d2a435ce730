// One table of a tester's file, as the file says it: nothing is converted yet.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "recordings/exchange/testers/findings.h"

namespace ferrobench::recordings {

enum class Measurement { hysteresis, remanent_hysteresis, pulses, leakage, leakage_steps, fatigue };

struct TesterColumn {
  std::string name, unit;  // as in the heading
  std::vector<double> values;
};

// "Area [mm2]: 0.01", "Sample Thickness (um):<tab>0.26"
struct HeaderValue {
  std::string text, unit;
  std::optional<double> number{};  // where the text is one
  std::size_t line = 0;
};

struct HeaderLine {
  std::string text;  // UTF-8
  std::size_t line = 0;
};

struct TesterTable {
  std::string tester;       // "aixACCT TF Analyzer"
  std::string measurement;  // as the tester calls it
  std::string label;        // as the file does: "Table 3"
  Measurement kind = Measurement::hysteresis;
  std::vector<HeaderLine> file_header, header;
  std::vector<TesterColumn> columns;
  std::size_t first_line = 0;          // of the rows
  std::vector<std::size_t> blocks{};   // rows at which another pulse begins: their columns stood side by side
  std::vector<std::string> figures{};  // lines behind the rows
  Findings findings{};

  std::size_t rows() const { return columns.empty() ? 0 : columns.front().values.size(); }
  std::size_t line_of(std::size_t row) const;
  // Of the table's header, else of the file's; the first line of this name.
  std::optional<HeaderValue> find(std::string_view key) const;
  const TesterColumn* column(std::string_view name) const;  // nullptr if there is none
};

using TakeTable = std::function<void(TesterTable&&)>;
using Progress = std::function<void(double share)>;  // of the text, 0 to 1

std::optional<HeaderValue> header_value(const HeaderLine& line, std::string_view key);

}  // namespace ferrobench::recordings

#include "recordings/exchange/testers/number_rows.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <limits>

#include "base/fields.h"
#include "base/headings.h"
#include "base/no_value.h"

namespace ferrobench::recordings {
namespace {

constexpr std::size_t most_columns = 1000, rows_between_reports = 20000;

std::optional<double> plain_number(std::string_view text) {
  if (text.starts_with('+')) text.remove_prefix(1);
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || end != text.data() + text.size() || !std::isfinite(value)) return std::nullopt;
  return value;
}

std::optional<double> comma_number(std::string_view text) {
  std::array<char, 64> point{};
  const auto comma = text.find(',');
  if (comma == std::string_view::npos || text.size() > point.size() ||
      text.find('.') != std::string_view::npos)
    return std::nullopt;
  std::ranges::copy(text, point.begin());
  point.at(comma) = '.';
  return plain_number({point.data(), text.size()});
}

}  // namespace

std::optional<double> number_of(std::string_view text) {
  const auto cell = trimmed(text);
  if (const auto value = plain_number(cell)) return value;
  return comma_number(cell);
}

std::optional<double> NumberRows::with_mark(std::string_view cell) {
  if (const auto value = plain_number(cell)) {
    if (cell.find('.') == std::string_view::npos) return value;
    if (mark_ == ',') return std::nullopt;
    mark_ = '.';
    return value;
  }
  if (mark_ == '.') return std::nullopt;
  const auto value = comma_number(cell);
  if (value) mark_ = ',';
  return value;
}

double NumberRows::value_of(std::string_view cell, const TesterColumn& column) {
  if (const auto value = with_mark(cell)) return overloads_.checked(*value, cell, lines_.number());
  if (is_no_value(cell)) {
    if (gaps_++ == 0) first_gap_ = lines_.number();
    return std::numeric_limits<double>::quiet_NaN();
  }
  const bool mixed = mark_ != 0 && number_of(cell).has_value();
  lines_.refuse("column " + excerpt(column.name) + " is not a number", cell.empty() ? "nothing" : cell,
                mixed ? std::string("the decimal mark of this file is '") + mark_ + "'" : "");
}

void NumberRows::read(TesterTable& table) {
  std::vector<std::string_view> cells;
  table.first_line = lines_.number() + 1;
  const auto width = table.columns.size();
  while (lines_.next()) {
    if (lines_.is_blank()) break;
    split_tabs(lines_.text(), cells);
    if (cells.size() != width)
      lines_.refuse("has " + std::to_string(cells.size()) + " columns, not " + std::to_string(width) +
                        " as the heading says",
                    cells.back(), "the file was cut off or changed; export it once more");
    for (std::size_t i = 0; i < width; ++i)
      table.columns[i].values.push_back(value_of(cells[i], table.columns[i]));
    if (progress_ && table.rows() % rows_between_reports == 0) progress_(lines_.share_done());
  }
  overloads_.tell(table.findings);
  if (gaps_ > 0)
    table.findings.push_back({"gap", std::to_string(gaps_) + " cells hold no value, the first in line " +
                                         std::to_string(first_gap_) + ": gaps"});
}

void read_headings(std::string_view line, TesterTable& table) {
  std::vector<std::string_view> cells;
  split_tabs(line, cells);
  if (cells.size() > most_columns) cells.resize(most_columns);
  for (const auto cell : cells) {
    const auto text = to_utf8(cell);
    std::string_view name = text, unit;
    for (const std::string_view brackets : {"[]", "()"})
      if (const auto open = text.find(brackets[0]);
          text.ends_with(brackets[1]) && open != std::string::npos) {
        name = trimmed(std::string_view(text).substr(0, open));
        unit = std::string_view(text).substr(open + 1, text.size() - open - 2);
        break;
      }
    table.columns.push_back({std::string(name), std::string(unit), {}});
  }
}

}  // namespace ferrobench::recordings

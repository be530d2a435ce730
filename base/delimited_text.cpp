#include "base/delimited_text.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <limits>
#include <utility>

#include "base/fields.h"
#include "base/no_value.h"

namespace ferrobench {
namespace {

constexpr std::size_t longest_quoted = 1u
                                       << 16;  // a quote that is not closed would take the rest of the text
constexpr std::size_t most_columns = 10000, rows_looked_at = 20;
constexpr double gap = std::numeric_limits<double>::quiet_NaN();

bool begins_a_number(std::string_view text) {
  return !text.empty() && (std::string_view("+-.").find(text[0]) != std::string_view::npos ||
                           (text[0] >= '0' && text[0] <= '9'));
}

}  // namespace

DelimitedText::DelimitedText(std::string_view text, const TextDialect& dialect, std::string path,
                             std::vector<Problem>& problems, std::size_t most)
    : rest_(text),
      whole_(text.size()),
      path_(std::move(path)),
      problems_(&problems),
      most_(most),
      line_(dialect.first_line) {
  constexpr std::string_view byte_order_mark = "\xef\xbb\xbf";
  if (rest_.starts_with(byte_order_mark)) rest_.remove_prefix(byte_order_mark.size());
  if (dialect.decimal_comma) decimal_mark_ = *dialect.decimal_comma ? ',' : '.';
  const char separator = separator_line();
  delimiter_ = dialect.delimiter ? *dialect.delimiter : separator != 0 ? separator : find_delimiter(rest_);
  if (!row()) return;
  columns_ = cells_.size();
  const auto is_number = [this](std::string_view cell) { return is_no_value(cell) || value_of(cell); };
  const auto mark = decimal_mark_;
  again_ = !dialect.names.value_or(std::ranges::none_of(cells_, is_number));
  decimal_mark_ = mark;
  if (again_) return;
  while (columns_ > 0 && cells_[columns_ - 1].empty()) --columns_;
  names_.assign(cells_.begin(), cells_.begin() + static_cast<std::ptrdiff_t>(columns_));
}

// Passes over "sep=;", and says which it is; 0 if there is no such line.
char DelimitedText::separator_line() {
  constexpr std::string_view key = "sep=";
  const auto size = key.size() + 1;
  if (!rest_.starts_with(key) || rest_.size() <= size || !is_end(rest_[size]) || is_end(rest_[size - 1]))
    return 0;
  const char out = rest_[size - 1];
  rest_.remove_prefix(size);
  skip_line_end();
  return out;
}

// The one by which most of the first rows are equally many numbers; if there is none, equally many cells.
char DelimitedText::find_delimiter(std::string_view text) const {
  char best = ',';
  std::pair<std::size_t, std::size_t> most{0, 0};
  for (const char delimiter : {'\t', ';', ',', ' '}) {
    std::vector<Problem> ignored;
    auto trial = *this;
    trial.rest_ = text;
    trial.problems_ = &ignored;
    trial.delimiter_ = delimiter;
    std::size_t width = 0, numbers = 0, alike = 0;
    for (std::size_t i = 0; i < rows_looked_at && trial.row(); ++i) {
      const auto& cells = trial.cells_;
      if (cells.size() < 2) continue;
      if (width != cells.size()) alike = numbers = 0;
      width = cells.size();
      ++alike;
      numbers += std::ranges::all_of(cells, [&](std::string_view cell) {
        trial.decimal_mark_ = decimal_mark_;
        return cell.empty() || trial.value_of(cell);
      });
    }
    if (const std::pair found{numbers, alike}; found > most) {
      most = found;
      best = delimiter;
    }
  }
  return best;
}

double DelimitedText::share_done() const {
  return whole_ == 0 ? 1 : 1 - static_cast<double>(rest_.size()) / static_cast<double>(whole_);
}

bool DelimitedText::next() {
  if (std::exchange(again_, false)) return true;
  while (problems_->size() < most_ && row()) {
    const auto written = static_cast<std::size_t>(
        std::find_if(cells_.rbegin(), cells_.rend(), [](std::string_view c) { return !c.empty(); }).base() -
        cells_.begin());
    if (cells_.size() >= columns_ && written <= columns_) return fits_ = true;
    // Where no row is like the first, that one is no part of the table, and one such line tells it.
    broken_ = !fits_ && columns_ > 0 && !names_.empty();
    complain("has " + std::to_string(std::max(written, std::min(cells_.size(), columns_))) +
                 " columns, not " + std::to_string(columns_) + " as the first row",
             cells_.empty() ? "" : cells_.back(), broken_ ? "put # before the lines above the table" : "");
  }
  return false;
}

double DelimitedText::number(std::size_t column, std::string_view hint) {
  const auto cell = cells_[column];
  if (cell.empty() || is_no_value(cell)) return gap;
  if (const auto value = value_of(cell)) return *value;
  const bool mixed =
      decimal_mark_ != 0 && cell.find(decimal_mark_ == ',' ? '.' : ',') != std::string_view::npos;
  const auto why = may_be_thousands(cell)
                       ? "it may be 1000 times more: say whether the decimal mark is a comma"
                   : mixed ? std::string("the decimal mark of this table is '") + decimal_mark_ + "'"
                           : std::string(hint);
  complain(column_name(column) + " is not a number", cell, why);
  return gap;
}

std::optional<double> DelimitedText::number_if_any(std::size_t column) {
  const auto cell = cells_[column];
  if (cell.empty() || is_no_value(cell)) return gap;
  const auto mark = decimal_mark_;
  const auto out = value_of(cell);
  decimal_mark_ = mark;
  return out;
}

std::string DelimitedText::column_name(std::size_t column) const {
  auto out = "column " + std::to_string(column + 1);
  if (column < names_.size() && !names_[column].empty()) out += " (" + excerpt(names_[column]) + ")";
  return out;
}

void DelimitedText::complain(const std::string& message, std::string_view given, const std::string& hint) {
  problems_->push_back({.path = path_,
                        .message = "line " + std::to_string(row_line_) + ": " + message,
                        .given = given.empty() ? nlohmann::json() : nlohmann::json(excerpt(given)),
                        .hint = hint});
}

// What is read decides on the decimal mark, if nothing has yet.
std::optional<double> DelimitedText::value_of(std::string_view cell) {
  constexpr std::size_t longest = 64;
  if (!begins_a_number(cell)) return std::nullopt;
  if (cell.starts_with("+-")) return std::nullopt;
  if (cell[0] == '+') cell.remove_prefix(1);
  const auto at = cell.find_first_of(".,");
  const char mark = at == std::string_view::npos ? decimal_mark_ : cell[at];
  if (decimal_mark_ != 0 && mark != decimal_mark_) return std::nullopt;
  if (may_be_thousands(cell)) return std::nullopt;
  std::array<char, longest> point{};
  if (mark == ',' && at != std::string_view::npos) {
    if (cell.size() > longest) return std::nullopt;
    std::ranges::copy(cell, point.begin());
    point.at(at) = '.';
    cell = {point.data(), cell.size()};
  }
  double value = 0;
  const auto [end, error] = std::from_chars(cell.data(), cell.data() + cell.size(), value);
  if (error != std::errc{} || end != cell.data() + cell.size() || !std::isfinite(value)) return std::nullopt;
  decimal_mark_ = mark;
  return value;
}

// "1,500" between commas, before any decimal has come: 1500 or 1.5.
bool DelimitedText::may_be_thousands(std::string_view cell) const {
  const auto comma = cell.find(',');
  return decimal_mark_ == 0 && delimiter_ == ',' && comma != std::string_view::npos &&
         cell.size() == comma + 4 &&
         cell.find_first_not_of("0123456789", comma + 1) == std::string_view::npos;
}

// The next row that says something.
bool DelimitedText::row() {
  while (!rest_.empty() && !broken_) {
    row_line_ = line_;
    skip_blanks();
    if (skip_line_end()) continue;
    if (rest_.starts_with('#')) {
      rest_.remove_prefix(std::min(rest_.size(), rest_.find_first_of("\r\n")));
      continue;
    }
    if (row_of_cells() && std::ranges::any_of(cells_, [](std::string_view c) { return !c.empty(); }))
      return true;
  }
  return false;
}

bool DelimitedText::row_of_cells() {
  cells_.clear();
  unquoted_.clear();
  const bool of_numbers = begins_a_number(rest_);
  bool after_blank = false;
  for (;;) {
    const auto before = rest_.size();
    skip_blanks();
    if (!rest_.starts_with('"'))
      plain_cell(of_numbers, after_blank || rest_.size() < before);
    else if (!quoted_cell())
      return false;
    if (cells_.size() > most_columns) {
      complain("has more columns than can be read", "");
      broken_ = true;
      return false;
    }
    switch (end_of_cell()) {
      case End::cell:
        after_blank = delimiter_ == ' ';
        continue;
      case End::row:
        return true;
      case End::none:
        complain("column " + std::to_string(cells_.size()) + " goes on behind its closing quote",
                 cells_.back());
        rest_.remove_prefix(std::min(rest_.size(), rest_.find_first_of("\r\n")));
        return false;
    }
  }
}

DelimitedText::End DelimitedText::end_of_cell() {
  const bool blank = !rest_.empty() && is_blank(rest_[0]);
  skip_blanks();
  if (skip_line_end() || rest_.empty()) return End::row;
  if (delimiter_ == ' ') return blank ? End::cell : End::none;
  if (rest_[0] != delimiter_) return End::none;
  rest_.remove_prefix(1);
  return End::cell;
}

void DelimitedText::plain_cell(bool of_numbers, bool after_blank) {
  std::size_t length = 0;
  bool comment = false;
  for (; length < rest_.size() && !is_end(rest_[length]); ++length) {
    const char c = rest_[length];
    if (delimiter_ == ' ' ? is_blank(c) : c == delimiter_) break;
    comment = of_numbers && c == '#' && (length == 0 ? after_blank : is_blank(rest_[length - 1]));
    if (comment) break;
  }
  auto cell = rest_.substr(0, length);
  rest_.remove_prefix(comment ? std::min(rest_.size(), rest_.find_first_of("\r\n")) : length);
  while (!cell.empty() && is_blank(cell.back())) cell.remove_suffix(1);
  if (cell.empty() && delimiter_ == ' ') return;  // a comment behind the last one
  cells_.push_back(cell);
}

bool DelimitedText::quoted_cell() {
  rest_.remove_prefix(1);
  std::size_t end = 0;
  bool doubled = false;
  for (; end < std::min(rest_.size(), longest_quoted); ++end) {
    if (rest_[end] != '"') continue;
    if (end + 1 == rest_.size() || rest_[end + 1] != '"') break;
    doubled = true;
    ++end;
  }
  if (end >= rest_.size() || rest_[end] != '"') {
    complain("column " + std::to_string(cells_.size() + 1) + " has a quote that is not closed",
             rest_.substr(0, 40));
    broken_ = true;
    return false;
  }
  auto cell = rest_.substr(0, end);
  rest_.remove_prefix(end + 1);
  for (std::size_t i = 0; i < cell.size(); ++i)
    if (cell[i] == '\n' || (cell[i] == '\r' && !cell.substr(i + 1).starts_with('\n'))) ++line_;
  if (doubled) {
    auto& plain = unquoted_.emplace_back();
    for (std::size_t i = 0; i < cell.size(); ++i) {
      plain += cell[i];
      if (cell[i] == '"') ++i;
    }
    cell = plain;
  }
  cells_.push_back(cell);
  return true;
}

void DelimitedText::skip_blanks() {
  while (!rest_.empty() && is_blank(rest_[0])) rest_.remove_prefix(1);
}

bool DelimitedText::skip_line_end() {
  if (rest_.empty() || !is_end(rest_[0])) return false;
  rest_.remove_prefix(rest_.starts_with("\r\n") ? 2 : 1);
  ++line_;
  return true;
}

}  // namespace ferrobench

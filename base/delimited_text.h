// A table in text as spreadsheets, loggers and people write it: RFC 4180, and what is around in practice.
//
//     cells      split by comma, semicolon, tab or white space. In quotes they may hold these, line ends, and
//     ""
//                for a quote
//     lines      end in LF, CRLF or CR. Empty ones are left out, and so is a line that begins with #, and the
//                rest of a row of numbers from a # behind a blank on. A byte-order mark is passed over
//     numbers    1.5e-3, +2, 0,5: the decimal mark is the first one that comes; nothing for a gap, or what
//                no_value.h has
//     first row  names, unless one of its cells is a number; before it may stand sep=X as spreadsheets write
//     it
//
// There is one row in memory at a time, besides the text.
#pragma once

#include <deque>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/error.h"

namespace ferrobench {

// What is not given is found from the first rows.
struct TextDialect {
  std::optional<char> delimiter{};  // ',' ';' '\t', or ' ' for any white space
  std::optional<bool> decimal_comma{};
  std::optional<bool> names{};  // whether the first row holds them
  std::size_t first_line = 1;   // of the text in its file, for messages
};

class DelimitedText {
 public:
  // `text` and `problems` must outlive it. A problem has this path and says line and column; after `most` of
  // them there are no more rows.
  DelimitedText(std::string_view text, const TextDialect& dialect, std::string path,
                std::vector<Problem>& problems, std::size_t most);

  const std::vector<std::string>& names() const { return names_; }  // empty if the first row has numbers
  std::size_t columns() const {
    return columns_;
  }  // of the first row; of names, without empty ones at the end
  char delimiter() const { return delimiter_; }

  double share_done() const;  // of the text, 0 to 1
  bool next();  // false at the end; a row with more or fewer cells than the first one is passed over
  std::size_t line() const { return row_line_; }  // where the row begins, from 1
  std::string_view text(std::size_t column) const { return cells_[column]; }
  // NaN for a gap, and for what is no number, which is a problem with this hint.
  double number(std::size_t column, std::string_view hint = "");
  // Without a problem, and the decimal mark stays open.
  std::optional<double> number_if_any(std::size_t column);

  // "column 3 (field)"
  std::string column_name(std::size_t column) const;
  void complain(const std::string& message, std::string_view given, const std::string& hint = "");

 private:
  enum class End { none, cell, row };

  bool row();
  bool row_of_cells();
  End end_of_cell();
  bool quoted_cell();
  void plain_cell(bool of_numbers, bool after_blank);
  void skip_blanks();
  bool skip_line_end();
  bool is_blank(char c) const { return c == ' ' || (c == '\t' && delimiter_ != '\t'); }
  static bool is_end(char c) { return c == '\n' || c == '\r'; }
  std::optional<double> value_of(std::string_view cell);
  char separator_line();
  bool may_be_thousands(std::string_view cell) const;
  char find_delimiter(std::string_view text) const;

  std::string_view rest_;
  std::size_t whole_ = 0;  // bytes
  std::string path_;
  std::vector<Problem>* problems_;
  std::size_t most_;
  char delimiter_ = ',';
  char decimal_mark_ = 0;  // not seen yet
  std::size_t line_ = 1, row_line_ = 1, columns_ = 0;
  bool again_ = false, broken_ = false, fits_ = false;  // a row has been as wide as the first
  std::vector<std::string> names_;
  std::vector<std::string_view> cells_;
  std::deque<std::string> unquoted_;  // cells that do not stand in the text as they are
};

}  // namespace ferrobench

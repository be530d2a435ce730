// Rows of numbers between tabs, as testers write them, into columns.
#pragma once

#include <optional>
#include <string_view>

#include "recordings/exchange/testers/lines.h"
#include "recordings/exchange/testers/overloads.h"
#include "recordings/exchange/testers/tester_table.h"

namespace ferrobench::recordings {

// 1.5e-003, and with a comma as a spreadsheet leaves it; not finite or anything else: none.
std::optional<double> number_of(std::string_view text);

// From the line after this one to one that is blank, to `end` if there is such a line, or to the end of the
// text. A cell that is no number, or a row with another number of cells, is Error(bad_recording) with its
// line. What a tester writes for "no value" or an overload is a gap, and told.
class NumberRows {
 public:
  NumberRows(Lines& lines, const Progress& progress) : lines_(lines), progress_(progress) {}
  void read(TesterTable& table);

 private:
  double value_of(std::string_view cell, const TesterColumn& column);
  std::optional<double> with_mark(std::string_view cell);

  Lines& lines_;
  const Progress& progress_;
  char mark_ = 0;  // of decimals; not seen yet
  std::size_t gaps_ = 0, first_gap_ = 0;
  Overloads overloads_;
};

// "Time [s]", "Time (ms)", "Drive Voltage" as columns of a table.
void read_headings(std::string_view line, TesterTable& table);

}  // namespace ferrobench::recordings

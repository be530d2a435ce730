// Columns with a heading that are no channel: those of numbers go along beside the channels, and all are
// told.
#pragma once

#include <string>
#include <vector>

#include "base/delimited_text.h"
#include "recordings/exchange/conversion/measured.h"
#include "recordings/exchange/testers/overloads.h"
#include "recordings/exchange/testers/tester_table.h"

namespace ferrobench::recordings {

class UnreadColumns {
 public:
  void add(std::size_t at, const std::string& heading);
  void take_row(DelimitedText& table, Overloads& overloads);
  // A tester's records begin with words, and each of its channels has the time once more: neither is told.
  void finish(Measured& m, bool of_tester);

 private:
  struct Column {
    std::size_t at = 0;
    std::string heading{};
    bool numbers = true;
    Values values{};
  };
  std::vector<Column> columns_;
};

}  // namespace ferrobench::recordings

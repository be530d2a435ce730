// Columns of a tester's table in SI units.
#pragma once

#include <initializer_list>

#include "base/headings.h"
#include "recordings/exchange/conversion/measured.h"
#include "recordings/exchange/testers/tester_table.h"

namespace ferrobench::recordings {

// The column of this name out of the table, in SI units; its unit is `unit` where the heading has none, and
// one that is not understood is Error(bad_recording).
std::optional<Values> take_column(TesterTable& table, std::string_view name, Quantity quantity,
                                  std::string_view unit = "");
Values demand_column(TesterTable& table, std::string_view name, Quantity quantity,
                     std::string_view unit = "");
// All columns that are left go along: those of one value only are not told to be anything measured.
void take_others(TesterTable& table, Measured& m);
// Error(bad_recording) with its line, unless it rises.
void demand_rising_time(const Measured& m);
bool is_measured(const Values& values);  // it has more than one value

}  // namespace ferrobench::recordings

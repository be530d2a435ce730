// What a table of numbers holds where there is no value.
#pragma once

#include <string_view>

namespace ferrobench {

// NaN as C libraries and programs write it, a spreadsheet's #N/A, a meter's OVLD; case does not count. An
// empty cell is the reader's affair.
bool is_no_value(std::string_view cell);

// Meters write 9.9E37 or 9.91E+37 (SCPI) or 199.999E+99 (B1500) where a range is exceeded.
bool marks_an_overload(double value);

// For whoever wrote something else.
inline constexpr std::string_view no_value_hint = "where there is no value, leave it empty or write NaN";

}  // namespace ferrobench

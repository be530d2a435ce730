// What a table of numbers holds where there is no value.
#pragma once

#include <string_view>

namespace ferrobench {

// NaN as C libraries and programs write it, a spreadsheet's #N/A, a meter's OVLD; case does not count. An
// empty cell is the reader's affair.
bool is_no_value(std::string_view cell);

// For whoever wrote something else.
inline constexpr std::string_view no_value_hint = "where there is no value, leave it empty or write NaN";

}  // namespace ferrobench

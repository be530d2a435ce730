// What columns without names hold, for an error that asks which is which.
#pragma once

#include <nlohmann/json.hpp>
#include <string_view>

#include "base/delimited_text.h"

namespace ferrobench::recordings {

// ["column 2 rises from 0 to 0.0198", ...] of its first rows; null if the columns have names.
nlohmann::json what_columns_hold(std::string_view text, const DelimitedText& table);

}  // namespace ferrobench::recordings

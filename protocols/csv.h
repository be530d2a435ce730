// Time and level pairs from CSV text.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "protocols/common/error.h"

namespace ferrobench::protocols {

// Two numbers a line, split by comma, semicolon, tab or spaces; empty lines and lines from # on are left out,
// and so is one line of column names at the top. Problems are added with `path` and say the line.
std::vector<std::vector<double>> read_points(std::string_view text, const std::string& path,
                                             std::vector<Problem>& problems);

}  // namespace ferrobench::protocols

// Numbers as text, the same wherever the program runs.
#pragma once

#include <string>

namespace ferrobench {

std::string number_text(double value);     // four significant digits
std::string number_in_full(double value);  // reads back to the same double

}  // namespace ferrobench

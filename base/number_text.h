// Numbers as text, the same wherever the program runs.
#pragma once

#include <string>
#include <utility>

namespace ferrobench {

std::string number_text(double value);  // four significant digits
// Both with as many digits, four at least, as tell them apart.
std::pair<std::string, std::string> interval_text(double low, double high);
std::string number_in_full(double value);  // reads back to the same double

}  // namespace ferrobench

// Cells by which a meter says that a range was exceeded: gaps, and told.
#pragma once

#include <limits>
#include <string>
#include <string_view>

#include "base/no_value.h"
#include "recordings/exchange/testers/findings.h"

namespace ferrobench::recordings {

class Overloads {
 public:
  // NaN in place of a mark.
  double checked(double value, std::string_view cell, std::size_t line) {
    if (!marks_an_overload(value)) return value;
    if (count_++ == 0) first_ = std::string(cell) + ", the first in line " + std::to_string(line);
    return std::numeric_limits<double>::quiet_NaN();
  }
  void tell(Findings& findings) const {
    if (count_ > 0)
      findings.push_back(
          {"warning", (count_ == 1 ? "one cell marks" : std::to_string(count_) + " cells mark") +
                          std::string(" an overload of the meter by ") + first_ + ": gaps"});
  }

 private:
  std::size_t count_ = 0;
  std::string first_;
};

}  // namespace ferrobench::recordings

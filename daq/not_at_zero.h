// What is said, by whoever finds out, of an output that may not be at zero: the person at the bench must act.
// One line, as it stands in a status and in a recording.
#pragma once

#include <string>

#include "base/visible.h"

namespace ferrobench::daq {

inline std::string not_at_zero(const std::string& why) {
  return "the output may not be at zero, switch the amplifier off: " + in_one_line(why);
}

}  // namespace ferrobench::daq

// Measured values against the limits, compared in counts: two comparisons a sample.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "daq/device.h"
#include "daq/guard/limits.h"

namespace ferrobench::daq {

class Trips {
 public:
  Trips(const Limits& limits, std::span<const recordings::RawColumn> columns);
  // What the first column out of its limits shows, or nothing.
  std::optional<std::string> violation(const SampleBlock& block) const;

 private:
  struct Window {
    recordings::Channel channel;
    std::size_t column;
    double gain, offset;
    double min, max;      // SI
    int lowest, highest;  // counts still allowed
  };
  std::size_t columns_;
  std::vector<Window> windows_;
};

}  // namespace ferrobench::daq

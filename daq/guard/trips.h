// Measured values against the limits, compared in counts: two comparisons a sample.
//
// A converter at its end says "at least this". Where a limit of displacement or force lies beyond that end,
// nobody knows whether it is kept, and the reading counts as a violation; but not at an end where the
// specimen rests, as of a sensor that counts from there. The limit of the field does not need that: no level
// beyond it goes out, and monitors often end where the amplifier does.
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
  // `measured`: the readings are of now; a replay's were judged when they were measured.
  Trips(const Limits& limits, std::span<const recordings::RawColumn> columns, bool measured);
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

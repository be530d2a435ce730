// A sensor with its channel of the 16-bit converter: value -> gain and offset errors, noise -> counts.
// SI value of a count = lsb * count, lsb = range / 32768; the sensor's errors are not undone by it.
#pragma once

#include <cstdint>
#include <span>

#include "daq/virtual/noise.h"
#include "recordings/format/recording.h"

namespace ferrobench::daq {

struct Sensor {
  double range = 1;   // SI, full scale: -range .. range
  double noise = 0;   // SI, standard deviation
  double gain = 1;    // 1
  double offset = 0;  // SI
};

class Converter {
 public:
  Converter(recordings::Channel channel, const Sensor& sensor, std::uint64_t seed);

  const Sensor& sensor() const { return sensor_; }
  recordings::RawColumn column() const {
    return {.channel = channel_, .gain = sensor_.range / 32768, .offset = 0};
  }

  // Values of the rows from `first_row` on (overwritten) into every `stride`-th of `counts`. True if any was
  // clipped.
  bool convert(std::uint64_t first_row, std::span<double> values, std::int16_t* counts,
               std::size_t stride) const;

 private:
  recordings::Channel channel_;
  Sensor sensor_;
  Noise noise_;
};

}  // namespace ferrobench::daq

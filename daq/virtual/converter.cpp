#include "daq/virtual/converter.h"

#include <algorithm>
#include <cmath>

namespace ferrobench::daq {

Converter::Converter(recordings::Channel channel, const Sensor& sensor, std::uint64_t seed)
    : channel_(channel), sensor_(sensor), noise_(seed, static_cast<std::uint64_t>(channel)) {}

bool Converter::convert(std::uint64_t first_row, std::span<double> values, std::int16_t* counts,
                        std::size_t stride) const {
  const double scale = 32768 / sensor_.range;
  const double gain = sensor_.gain * scale;
  const double offset = sensor_.offset * scale + 0.5;
  for (double& v : values) v = v * gain + offset;
  noise_.add(first_row, sensor_.noise * scale, values);

  bool clipped = false;
  for (std::size_t i = 0; i < values.size(); ++i) {
    const double whole = std::floor(values[i]);
    // A value that is not a number clips, too.
    clipped |= !(whole >= -32768 && whole <= 32767);
    counts[i * stride] = static_cast<std::int16_t>(whole >= -32768 ? std::min(whole, 32767.0) : -32768.0);
  }
  return clipped;
}

}  // namespace ferrobench::daq

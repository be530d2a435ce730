// A device plays a sampled field program and returns blocks of samples. Virtual bench, replay and hardware differ
// behind this interface only.
#pragma once

#include <cstdint>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "protocols/waveform.h"
#include "recordings/recording.h"

namespace ferrobench::daq {

// What happened in a block, carried with the data.
enum class BlockStatus { ok, overrun, underrun, timeout, short_data, stall, device_lost, clipped };
std::string_view block_status_name(BlockStatus status);

// `rows` rows by `columns` counts, row after row; the columns are those of Device::columns().
struct SampleBlock {
  std::uint64_t first_sample = 0;
  std::size_t rows = 0;
  std::vector<std::int16_t> counts;
  BlockStatus status = BlockStatus::ok;
  std::string message;
};

class Device {
 public:
  virtual ~Device() = default;

  // Driver, serial number, firmware, ranges, rates asked for and got, calibration, limits: what the recording keeps.
  virtual nlohmann::json info() const = 0;
  // Raw columns in the order of a row, with the scaling to SI.
  virtual std::vector<recordings::RawColumn> columns() const = 0;
  // Known noise per channel in SI, where there is any.
  virtual std::array<std::optional<double>, 5> noise() const { return {}; }
  // The model behind the device, or null.
  virtual nlohmann::json model() const { return nullptr; }

  // Brings the output to `level` [V/m] at a slew of at most `slew` [V/m/s] and holds it there.
  virtual void go_to(double level, double slew) = 0;
  // Plays the program from its first sample; read() then yields every sample of it, in order.
  virtual void start(const protocols::SampledWaveform& program) = 0;
  // Moves the next samples into `block` (its storage is reused). False: the program is over.
  virtual bool read(SampleBlock& block) = 0;
  // Holds the field where it is while paused; only the time goes on. Samples keep coming.
  virtual void pause() = 0;
  virtual void resume() = 0;
  // Leaves the program: ramps to zero at `slew` and stops. Returns when the output is at zero; false if the device
  // could not be brought there. Samples taken meanwhile are still read() afterwards.
  virtual bool stop(double slew) = 0;
  // The level at the output now, V/m.
  virtual double output() const = 0;
};

}  // namespace ferrobench::daq

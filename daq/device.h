// The seam between the bench and what drives a specimen. Virtual bench, replay and hardware differ behind
// this interface only.
//
// A device never sees a program, it pulls from a LevelSource, and the only one it is given is the guard
// (guard/guard.h). So no level reaches an output unguarded, and pause, stop and trip need nothing from a
// driver. All calls come from one thread, the acquisition's; a driver may call LevelSource::next from a
// thread of its own.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/error.h"
#include "protocols/waveform.h"
#include "recordings/format/recording.h"

namespace ferrobench::daq {

// What happened in a block, carried with the data. misaligned: the channels are not where they belong, or the
// field is not the one asked for.
enum class BlockStatus {
  ok,
  overrun,
  underrun,
  timeout,
  short_data,
  stall,
  device_lost,
  clipped,
  misaligned
};
std::string_view block_status_name(BlockStatus status);

// `rows` rows by `columns` counts, row after row; the columns are those of Device::columns(). A first_sample
// past the end of the block before is a gap: those rows were lost. A block that comes from the guard has the
// rows that are recorded, and these have numbers of their own.
struct SampleBlock {
  std::uint64_t first_sample = 0;
  std::size_t rows = 0;
  std::vector<std::int16_t> counts;
  // What is known in SI beside the counts, or better than by them; empty: nothing. A channel that is here
  // wins over its counts, the command over the guard's, and `time` [s] over the row's number by the rate. NaN
  // is a gap.
  std::vector<double> time;
  std::array<std::vector<double>, 5> signals;  // by Channel
  BlockStatus status = BlockStatus::ok;
  std::string message;
  std::vector<double> command;            // filled by the guard: the field asked for in each row [V/m]
  std::vector<recordings::Event> events;  // what the record should say; the guard adds to it

  // All keep the storage.
  void clear();
  void drop_rows();
  // Leaves the rows for which `which` is not 0.
  void select(std::span<const std::uint8_t> which);
};

// The output goes linearly to `level` [V/m], where it is `samples` rows later.
struct LinearPiece {
  std::uint64_t samples = 0;
  double level = 0;
  bool waiting = false;  // a pause: the operator's time, which a clock "as fast as possible" must not skip
};

class LevelSource {
 public:
  virtual ~LevelSource() = default;
  // The next piece, at most max_samples long; 0 samples: the program is over. May be called from any thread.
  // A pause or stop comes into force with the next piece, so a driver queues no more than about 0.1 s ahead.
  virtual LinearPiece next(std::uint64_t max_samples) = 0;
  // The levels of the next rows, as next(1) gives them, and how many there are: fewer than asked for, the
  // program is over.
  virtual std::size_t next_levels(std::span<double> levels);
};

// V/m at the output.
struct OutputRange {
  double min = 0;
  double max = 0;
};

class Device {
 public:
  virtual ~Device() = default;

  // Driver, serial number, firmware, ranges, rates asked for and got, calibration: what the recording keeps.
  virtual nlohmann::json info() const = 0;
  // Raw columns in the order of a row, with the scaling to SI.
  virtual std::vector<recordings::RawColumn> columns() const = 0;
  // Channels whose values come in SI only.
  virtual std::vector<recordings::Channel> signals() const { return {}; }
  // Known noise per channel in SI (standard deviation), where there is any.
  virtual std::array<std::optional<double>, 5> noise() const { return {}; }
  // False: it has only answers that were recorded before.
  virtual bool measures() const { return true; }
  // The model behind the device, or null.
  virtual nlohmann::json model() const { return nullptr; }
  // What the output can reach.
  virtual OutputRange output_range() const = 0;
  // The steepest change of the output that its amplifier can follow, V/m/s.
  virtual double fastest_slew() const { return std::numeric_limits<double>::infinity(); }
  // The rate [rows/s] that the device runs at when asked for this one: its pacer has steps.
  // Throws Error(invalid_params) outside what it can do.
  virtual double scan_rate(double asked) const = 0;
  // What the device cannot do of a program, beyond its output range; paths are "/segments/N/...".
  virtual std::vector<Problem> problems(const protocols::SampledWaveform&) const { return {}; }
  // The specimen in it and its load, where there is no model that says so.
  virtual std::optional<recordings::Specimen> specimen() const { return std::nullopt; }
  virtual recordings::LoadCase load() const { return {}; }
  // What the specimen has been through until now, as far as the device knows.
  virtual protocols::Past past() const { return {}; }
  // False while the device's own interlock line is open.
  virtual bool interlock_closed() { return true; }

  // The level last brought to the output, V/m, as asked for; NaN where that is not known.
  virtual double output() const = 0;
  // Ends a stream if one is running, then brings the output linearly to `level` at `slew` [V/m/s] and returns
  // when it is there; nothing is recorded. Also the way to zero when a stream has failed, so it must not
  // depend on one.
  virtual void go_to(double level, double slew) = 0;
  // Row 0 is taken at the present output; then each piece of n samples gives n rows, until the source is
  // over. `source` outlives the stream.
  virtual void start(double rate, LevelSource& source) = 0;
  // Moves the next rows into `block` (its storage is reused). False: every row has been read. Returns within
  // a second or so even if nothing comes, with no rows and status timeout. Trouble goes into the status; a
  // throw ends the run.
  virtual bool read(SampleBlock& block) = 0;
};

}  // namespace ferrobench::daq

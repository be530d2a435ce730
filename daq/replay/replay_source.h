// A recording made ready to be played: what the guard plays, what the device answers, and what the new
// recording says of it.
//
// The program is the recorded command (the measured field where there is none), sample by sample. Where the
// command is not known it goes straight from the last known level to the next; what it was then stays unknown
// in the record.
#pragma once

#include <memory>
#include <span>

#include "daq/guard/guard.h"
#include "daq/replay/config.h"
#include "recordings/format/recording.h"

namespace ferrobench::daq {

class ReplaySource {
 public:
  // Throws Error(invalid_params) for a window without samples, Error(bad_recording) if there is no field to
  // play, or a scaling that cannot be one.
  ReplaySource(recordings::Recording recording, const ReplayConfig& config);

  // The part that is played, its SI values and noise in the new calibration.
  const recordings::Recording& recording() const { return recording_; }
  std::size_t size() const { return recording_.size(); }
  double rate() const { return rate_; }  // rows/s; where rows are not equally spaced, their mean
  // Whether each row's time is its number by the rate, to the bit.
  bool on_grid() const { return on_grid_; }
  double time(std::uint64_t row) const;  // s; past the end it goes on at the rate

  std::span<const recordings::RawColumn> columns() const { return columns_; }
  std::span<const recordings::Channel> signals() const { return signals_; }  // those without a column
  const std::vector<double>& command() const { return *command_; }           // V/m, as played
  // What is known from a row on, up to the next of these rows.
  enum class Known { all, not_the_command, only_the_command, nothing };
  struct Stretch {
    std::uint64_t first = 0;
    Known known = Known::all;
  };
  std::span<const Stretch> stretches() const { return stretches_; }

  protocols::SampledWaveform program() const;
  // No voltage leaves a replay: the limits are as wide as what was recorded, and never narrower than `bench`.
  Limits limits(Limits bench) const;

  // The header of a recording of this replay, but for its device.
  recordings::Header header() const;
  // Status, reason and segments of a recording of this replay once a guard has ended: those of the recording
  // if it was played whole, else cut where it ended.
  struct Closing {
    std::string status, reason;
    std::vector<recordings::SegmentRow> segments;
  };
  // `played`: the guard's segments.
  Closing closing(End end, const std::string& reason, std::vector<recordings::SegmentRow> played,
                  std::uint64_t rows_read) const;

 private:
  void calibrate(const ReplayConfig& config);
  void find_command();
  void find_grid();
  void find_stretches();

  recordings::Recording recording_;
  std::vector<recordings::RawColumn> columns_;
  std::vector<recordings::Channel> signals_;
  std::shared_ptr<const std::vector<double>> command_;
  std::vector<Stretch> stretches_;
  double rate_ = 1;
  bool on_grid_ = true;
};

}  // namespace ferrobench::daq

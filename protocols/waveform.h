// The field program as a function of time, and its samples.
//
// A waveform is a list of pieces that follow each other without a gap: ramps and holds (linear in time),
// sines and recorded samples (linear in between). Every value is an electric field in V/m, along the poling
// direction; times are in s from the start of the program.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "protocols/recorded_rows.h"

namespace ferrobench::protocols {

enum class PieceKind { ramp, hold, sine, samples };

// ramp: from -> to, linear. hold: from == to. sine: center + amplitude sin(2 pi frequency (t - start) +
// phase), with from and to its values at both ends. samples: `levels` at equal steps, from and to being the
// first and the last of them.
struct Piece {
  PieceKind kind = PieceKind::hold;
  double start = 0;     // s
  double duration = 0;  // s, > 0
  double from = 0;      // V/m
  double to = 0;        // V/m
  double center = 0, amplitude = 0, frequency = 0, phase = 0;
  double sampling = 0;  // S/s, the fewest that resolve it; 0: any do
  Recorded recorded{};
  std::shared_ptr<const std::vector<double>> levels{};  // V/m, two or more

  double value(double time_from_start_of_program) const;
  double max_slew() const;  // V/m/s, largest |dE/dt|
};

// One row of the segment table. kind: "ramp" or "hold" (a sine counts as "ramp").
struct Segment {
  std::string kind{};
  std::string label{};
  double start = 0, end = 0;  // s
  double level = 0;           // V/m, at the end
  double rate = 0;            // V/m/s, magnitude; 0 for a hold
  std::string path{};         // JSON pointer into the protocol that it comes from; "" if there is none
};

// The repeat of a program that is averaged.
struct AveragedRepeat {
  std::string path{};                // JSON pointer into the protocol
  std::vector<std::size_t> begin{};  // the first piece of each pass, and the first one after the last
};

// The unit in which the author of a program wrote levels, and per second rates. A level l is
// l * unit / divisor in V/m: two numbers, so that 150 V over 1e-4 m round as people's own arithmetic does.
struct LevelUnit {
  std::string name = "V/m";
  double unit = 1, divisor = 1;
  double field(double level) const { return level * unit / divisor; }
  double level(double field) const { return field * divisor / unit; }
  std::string rate_name() const { return name + "/s"; }
};

class Waveform {
 public:
  Waveform() = default;
  // Throws std::invalid_argument if pieces do not join in time (pieces and segments correspond one to one).
  Waveform(std::vector<Piece> pieces, std::vector<Segment> segments, LevelUnit unit = {},
           std::optional<AveragedRepeat> averaged = {});

  std::span<const Piece> pieces() const { return pieces_; }
  std::span<const Segment> segments() const { return segments_; }
  const LevelUnit& unit() const { return unit_; }
  const std::optional<AveragedRepeat>& averaged() const { return averaged_; }
  // What a problem with a piece points to: the segment of the protocol, or the row of the segment table.
  std::string place(std::size_t piece) const;
  double duration() const;                  // s
  double value(double time) const;          // V/m; before the start the first value, after the end the last
  double minimum() const, maximum() const;  // V/m, exact
  double max_slew() const;                  // V/m/s; infinite if the level jumps between two pieces
  double sampling() const;                  // S/s, the fewest that resolve every piece; 0: any do
  // rows/s, the largest that a piece asks for itself; 0: none does.
  double fastest_recorded() const;

 private:
  std::vector<Piece> pieces_;
  std::vector<Segment> segments_;
  LevelUnit unit_;
  std::optional<AveragedRepeat> averaged_;
};

// The waveform on a grid of samples 1/rate apart. Every corner falls on a sample, with its exact level: a
// corner's index is its time rounded to the grid, but at least one sample after the corner before. With fewer
// samples than corners the program is stretched, and `distortion` says by how much.
//
// Not every sample needs to be recorded (recorded_rows.h): the corners always are, in between what the piece
// asks for, or `recorded` rows/s where it asks for nothing.
class SampledWaveform {
 public:
  SampledWaveform() = default;
  // rate in S/s, > 0; recorded in rows/s, 0: every sample.
  SampledWaveform(Waveform waveform, double rate, double recorded = 0);

  double rate() const { return rate_; }
  std::uint64_t size() const;                                   // samples, the last corner included
  double value(std::uint64_t sample) const;                     // V/m
  void fill(std::uint64_t first, std::span<double> out) const;  // past the end: the last level
  // Sample index of each corner: pieces().size() + 1 entries, strictly rising, from 0 to size() - 1.
  std::span<const std::uint64_t> corners() const { return corners_; }
  // Which samples after the piece's first are recorded.
  RecordedRows recorded_rows(std::size_t piece) const;
  double recorded_rate(std::size_t piece) const;  // rows/s, what is recorded of it at first
  std::uint64_t recorded_size() const;            // samples that are recorded
  const Waveform& waveform() const { return waveform_; }
  double distortion() const { return distortion_; }  // s, largest shift of a corner against the exact program
  // V/m/s, upper bound of what the samples do; above waveform().max_slew() where a corner came early.
  double max_slew() const { return max_slew_; }

 private:
  Waveform waveform_;
  double rate_ = 1;
  double recorded_ = 0;
  std::vector<std::uint64_t> corners_;
  double distortion_ = 0;
  double max_slew_ = 0;
};

}  // namespace ferrobench::protocols

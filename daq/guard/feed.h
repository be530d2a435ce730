// Turns a program into the pieces that go out, with pauses and the safe stop, and keeps account of them: the
// command of each row and whether it is recorded, the events, the segment table as played. Single-threaded;
// the guard holds the lock. While the program plays it asks for no memory, as long as its rows are taken
// within a second.
#pragma once

#include <string>
#include <vector>

#include "daq/device.h"
#include "daq/guard/limiter.h"
#include "daq/guard/limits.h"
#include "daq/guard/reverse_time.h"
#include "protocols/waveform.h"

namespace ferrobench::daq {

// How a run ended. Only `complete` makes a complete recording.
enum class End { none, complete, stopped, limit, interlock, fault };
std::string_view end_name(End end);

class Feed final : public LevelSource {
 public:
  // The output stands at the program's first level, which is row 0.
  Feed(protocols::SampledWaveform program, const Limits& limits);

  LinearPiece next(std::uint64_t max_samples) override;

  void pause();  // throws Error(bad_state) if no hold is left
  void resume();
  // From the next piece on the output goes to zero at stop_slew. The first reason stands.
  void stop(End end, const std::string& reason);
  // A stop under way goes on at this slew [V/m/s] if that is faster.
  void hasten(double slew);

  bool pausing() const { return pause_wanted_ && !paused_; }
  bool paused() const { return paused_; }
  bool stopping() const { return end_ != End::none; }
  bool over() const;
  End end() const { return end_; }
  const std::string& reason() const { return reason_; }

  double rate() const { return program_.rate(); }
  std::uint64_t issued() const { return issued_; }  // rows, row 0 included
  std::uint64_t expected() const;                   // rows by the end, if nothing more happens

  // Fills in the commands of the block's rows and leaves those that are recorded, numbered as such; their
  // times stand in the block if not every row of the program is recorded. Rows before the block's first were
  // lost. Each row can be taken once.
  void take_rows(SampleBlock& block);
  std::uint64_t recorded() const { return recorded_taken_; }  // rows taken or lost that are recorded
  // Events since the last call are moved to the end of `out`.
  void take_events(std::vector<recordings::Event>& out);
  // As issued, in recorded rows, cut off after `rows` of them.
  std::vector<recordings::SegmentRow> segments(std::uint64_t rows) const;

 private:
  LinearPiece program_piece(std::uint64_t max_samples);
  LinearPiece stop_piece(std::uint64_t max_samples);
  void account(const LinearPiece& piece, double from, bool corner);
  bool decide(bool corner);
  void open_segment(recordings::SegmentRow row);
  void say(std::string_view kind, std::string message);

  protocols::SampledWaveform program_;
  Limits limits_;
  double stop_slew_;
  Limiter limiter_;
  ReverseTimer reverse_;

  std::size_t index_ = 0;     // of the piece played now
  std::size_t opened_ = 0;    // pieces that stand in segments_
  std::uint64_t offset_ = 0;  // its samples issued so far
  std::uint64_t waited_ = 0;  // rows added by pauses
  std::uint64_t issued_ = 1;
  bool pause_wanted_ = false;
  bool paused_ = false;
  End end_ = End::none;
  std::string reason_;

  // Of rows issued and not yet taken, the first being row taken_; whether they are recorded only where not
  // every row of the program is.
  std::vector<double> commands_;
  std::vector<std::uint8_t> is_recorded_;
  std::uint64_t taken_ = 0;
  bool selects_ = false;          // not every row is recorded
  bool last_is_recorded_ = true;  // of the rows issued
  protocols::RecordedRows rows_;
  std::uint64_t recorded_issued_ = 1, recorded_taken_ = 0;
  std::vector<recordings::Event> events_;
  std::vector<recordings::SegmentRow> segments_;  // as played
  std::vector<recordings::SegmentRow> program_segments_;
};

}  // namespace ferrobench::daq

// Turns moves into the pieces and the segment table of a waveform, from a given level on.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "protocols/waveform.h"

namespace ferrobench::protocols {

class Builder {
 public:
  Builder(double level, LevelUnit unit) : unit_(std::move(unit)), level_(level) {}

  // What is added from now on belongs to the segment at this JSON pointer; its labels begin with `prefix`.
  // Throws Error(bad_protocol), as the moves below do, when the program gets too long.
  void enter(const std::string& path, std::string prefix);
  // What is added from now on is recorded so; rows per decade are for holds.
  void record(const Recorded& recorded) { recorded_ = recorded; }
  const Recorded& recorded() const { return recorded_; }
  // The repeat at this path is averaged; a program has one at the most. Throws as enter() does.
  void average(const std::string& path);
  void begin_pass() { averaged_->begin.push_back(pieces_.size()); }

  double level() const { return level_; }
  bool moves_to(double to) const;          // false where `to` is the present level, within same_level
  std::string direction(double to) const;  // " up" or " down"

  // Nothing happens where the level does not move.
  void ramp_to(double to, double rate, std::string_view label);
  void ramp_in(double to, double time, std::string_view label);
  void hold(double time, std::string_view label);
  // phase in radians. The program must be at the sine's first level. samples: the fewest a cycle, 0: any.
  void sine(double center, double amplitude, double frequency, double cycles, double phase,
            std::string_view label, double samples = 0);

  // Running numbers in the whole program, from 1.
  std::string next_ramp() { return std::to_string(++ramps_); }
  std::string next_hold() { return std::to_string(++holds_); }
  std::string next_reversal() { return std::to_string(++reversals_); }
  std::string next_bias() { return std::to_string(++biases_); }

  Waveform finish() {
    return {std::move(pieces_), std::move(segments_), std::move(unit_), std::move(averaged_)};
  }

 private:
  void step();
  void add(Piece piece, double rate, std::string_view label);

  LevelUnit unit_;
  double level_;
  double time_ = 0;
  std::size_t steps_ = 0;
  int ramps_ = 0, holds_ = 0, reversals_ = 0, biases_ = 0;
  std::string path_, prefix_;
  Recorded recorded_;
  std::optional<AveragedRepeat> averaged_;
  std::vector<Piece> pieces_;
  std::vector<Segment> segments_;
};

}  // namespace ferrobench::protocols

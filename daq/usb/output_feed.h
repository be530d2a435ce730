// The pieces of a LevelSource as codes for the output, tick after tick, with account of the level at each
// tick.
//
// Level 0 is the output as it is; a piece of n rows goes linearly to its level in n times the oversampling
// ticks. Inputs converted after the update of their tick see code k as tick k, so the codes begin with level
// 0; inputs converted before it see code k at tick k + 1, so the codes begin with level 1. Either way tick k
// is level k. After the source is over the last level stays.
#pragma once

#include <functional>
#include <vector>

#include "daq/device.h"
#include "daq/usb/config.h"

namespace ferrobench::daq::usb {

class OutputFeed {
 public:
  using ToCode = std::function<std::uint16_t(double level)>;
  OutputFeed(LevelSource& source, double level, std::uint64_t oversampling, TickOrder order, ToCode to_code);

  // Room for the levels of so many ticks that are not dropped: they may stand twice until they are erased.
  void reserve(std::size_t ticks) { levels_.reserve(2 * ticks + fewest_dropped); }
  // The next codes, as many as fit, little endian.
  void fill(std::span<std::byte> bytes);
  std::uint64_t filled() const { return filled_; }  // codes so far

  bool over() const { return over_; }
  // Rows that the source asked for, row 0 included; their number is final once over().
  std::uint64_t rows() const { return rows_; }
  // Levels [V/m] of the ticks not yet dropped that codes exist for.
  std::span<const double> levels() const { return std::span(levels_).subspan(dropped_); }
  void drop(std::size_t ticks);
  double last_dropped() const { return last_dropped_; }

 private:
  static constexpr std::size_t fewest_dropped = 4096;  // before they are erased, which moves the others
  double next_level(std::uint64_t wanted);

  LevelSource& source_;
  std::uint64_t oversampling_;
  ToCode to_code_;
  double from_, to_;                     // of the piece
  std::uint64_t length_ = 0, done_ = 0;  // of the piece, in ticks
  std::uint64_t rows_ = 1;
  std::uint64_t filled_ = 0;
  bool over_ = false;
  bool first_pending_;  // level 0 is still to be put out
  std::vector<double> levels_;
  std::size_t dropped_ = 0;
  double last_dropped_;
};

}  // namespace ferrobench::daq::usb

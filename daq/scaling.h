// From what a device sends to SI: value = offset + gain * count, column by column. What a block knows in SI
// takes the place of that.
#pragma once

#include <span>

#include "daq/device.h"
#include "recordings/format/parts.h"

namespace ferrobench::daq {

class Scaling {
 public:
  // `signals`: channels that come in SI only; `rate` in rows/s.
  Scaling(std::vector<recordings::RawColumn> columns, std::span<const recordings::Channel> signals,
          double rate);

  // What a recording of this device has: the command and whatever is measured.
  std::span<const recordings::Channel> channels() const { return channels_; }
  std::span<const recordings::RawColumn> columns() const { return columns_; }
  double rate() const { return rate_; }

  // Storage for blocks of so many rows.
  void reserve(std::size_t rows);

  // The block's rows in SI. Valid until the next call and as long as the block.
  recordings::Rows rows(const SampleBlock& block);
  // Rows that were lost on the way: NaN, and the lowest count. Their times are their numbers by the rate, or
  // those given.
  recordings::Rows gap(std::uint64_t first, std::size_t rows);
  recordings::Rows gap(std::span<const double> time);

 private:
  void number(std::uint64_t first, std::size_t rows);
  recordings::Rows nothing_measured();  // at the times of time_

  std::vector<recordings::RawColumn> columns_;
  std::vector<recordings::Channel> channels_;
  double rate_;
  std::vector<double> time_;
  std::array<std::vector<double>, 5> values_;  // by Channel
  std::vector<std::int16_t> counts_;
};

}  // namespace ferrobench::daq

#include "daq/scaling.h"

#include <algorithm>
#include <limits>

namespace ferrobench::daq {

using recordings::Channel;

Scaling::Scaling(std::vector<recordings::RawColumn> columns, std::span<const Channel> signals, double rate)
    : columns_(std::move(columns)), rate_(rate) {
  for (const auto channel : recordings::all_channels)
    if (channel == Channel::command ||
        std::ranges::any_of(columns_, [&](const auto& c) { return c.channel == channel; }) ||
        std::ranges::find(signals, channel) != signals.end())
      channels_.push_back(channel);
}

void Scaling::reserve(std::size_t rows) {
  time_.reserve(rows);
  for (const auto& column : columns_) values_.at(static_cast<std::size_t>(column.channel)).reserve(rows);
}

void Scaling::number(std::uint64_t first, std::size_t rows) {
  time_.resize(rows);
  for (std::size_t i = 0; i < rows; ++i) time_[i] = static_cast<double>(first + i) / rate_;
}

recordings::Rows Scaling::rows(const SampleBlock& block) {
  recordings::Rows out{.time = block.time, .channels = {}, .counts = block.counts};
  if (block.time.empty()) {
    number(block.first_sample, block.rows);
    out.time = time_;
  }
  const auto width = columns_.size();
  for (const auto channel : channels_) {
    const auto c = static_cast<std::size_t>(channel);
    auto& to = out.channels.at(c);
    if (channel == Channel::command) to = block.command;
    for (std::size_t k = 0; k < width; ++k) {
      if (columns_[k].channel != channel || !block.signals.at(c).empty()) continue;
      auto& values = values_.at(c);
      values.resize(block.rows);
      for (std::size_t i = 0; i < block.rows; ++i)
        values[i] = columns_[k].offset + columns_[k].gain * block.counts[i * width + k];
      to = values;
    }
    if (!block.signals.at(c).empty()) to = block.signals.at(c);
  }
  return out;
}

recordings::Rows Scaling::gap(std::uint64_t first, std::size_t rows) {
  number(first, rows);
  return nothing_measured();
}

recordings::Rows Scaling::gap(std::span<const double> time) {
  time_.assign(time.begin(), time.end());
  return nothing_measured();
}

recordings::Rows Scaling::nothing_measured() {
  const auto rows = time_.size();
  counts_.assign(rows * columns_.size(), std::numeric_limits<std::int16_t>::min());
  recordings::Rows out{.time = time_, .channels = {}, .counts = counts_};
  for (const auto channel : channels_) {
    auto& values = values_.at(static_cast<std::size_t>(channel));
    values.assign(rows, std::numeric_limits<double>::quiet_NaN());
    out.channels.at(static_cast<std::size_t>(channel)) = values;
  }
  return out;
}

}  // namespace ferrobench::daq

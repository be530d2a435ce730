// A device that plays into a watched output and can be told to fail in any of the ways that devices do.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "daq/device.h"
#include "daq/guard/limits.h"

namespace ferrobench::daq {

// Every sample of an output, against limits.
class WatchedOutput {
 public:
  explicit WatchedOutput(const Limits& limits) : limits_(limits) {}

  double level() const { return level_; }
  const std::string& crime() const { return crime_; }  // the first limit passed, or empty
  std::uint64_t samples() const { return samples_; }

  void put(double level, double interval) {
    const double slew = std::abs(level - level_) / interval;
    if (!(level >= limits_.field_min && level <= limits_.field_max)) accuse("level", level);
    // Levels are rounded to 2^-52 of themselves, so their differences cannot be better than that.
    const double rounding = 4e-16 * (limits_.field_max - limits_.field_min) / interval;
    if (!(slew <= limits_.slew * (1 + 1e-9) + rounding)) accuse("slew", slew);
    level_ = level;
    ++samples_;
  }

 private:
  void accuse(const char* what, double value) {
    if (crime_.empty())
      crime_ = std::string(what) + " " + std::to_string(value) + " at sample " + std::to_string(samples_);
  }

  Limits limits_;
  double level_ = 0;
  std::uint64_t samples_ = 0;
  std::string crime_;
};

enum class Fault {
  none,
  throws,
  throws_oddly,
  hangs,
  torn,
  stray,
  ends_early,
  lost,
  underrun,
  few_rows,
  gap
};
inline constexpr int fault_count = 11;

class FaultyDevice : public Device {
 public:
  explicit FaultyDevice(const Limits& limits) : watched(limits) {}

  nlohmann::json info() const override { return {{"driver", "faulty"}, {"clock", "fast"}}; }
  std::vector<recordings::RawColumn> columns() const override {
    return {{.channel = recordings::Channel::field, .gain = monitor_gain},
            {.channel = recordings::Channel::displacement, .gain = 1e-8}};
  }
  OutputRange output_range() const override { return {-1e12, 1e12}; }
  double scan_rate(double asked) const override { return asked; }
  std::optional<recordings::Specimen> specimen() const override {
    return recordings::Specimen{"specimen", 0.02, 2.5e-5, 1e-4, 1};
  }
  double output() const override { return watched.level(); }

  void go_to(double level, double slew) override {
    source_ = nullptr;
    if (deaf-- > 0) throw std::runtime_error("no answer");
    steepest_go_to = std::max(steepest_go_to, slew);
    const double from = watched.level();
    const double duration = std::abs(level - from) / slew;
    for (int i = 1; i < 4; ++i) watched.put(from + (level - from) * i / 4, duration / 4);
    watched.put(level, duration / 4);
  }
  void start(double rate, LevelSource& source) override {
    rate_ = rate;
    source_ = &source;
    row_ = 0;
    reads_ = 0;
  }
  bool read(SampleBlock& block) override {
    if (source_ == nullptr) return false;
    const bool now = reads_++ >= fault_at;
    const Fault f = now ? fault : Fault::none;
    switch (f) {
      case Fault::throws:
        throw std::runtime_error("cable pulled");
      case Fault::throws_oddly:
        throw 42;
      case Fault::ends_early:
        return false;
      case Fault::hangs:
        block.status = BlockStatus::timeout;
        return true;
      case Fault::lost:
        block.status = BlockStatus::device_lost;
        return true;
      case Fault::underrun:
        block.status = BlockStatus::underrun;
        return true;
      default:
        break;
    }
    const std::size_t rows = play(block);
    if (rows == 0) return false;
    block.first_sample = row_;
    block.rows = rows;
    row_ += rows;
    if (f == Fault::torn) block.counts.pop_back();
    if (f == Fault::stray) block.first_sample += 1000000;
    if (f == Fault::few_rows) block.status = BlockStatus::short_data;
    if (f == Fault::gap) {
      fault = Fault::none;
      block.status = BlockStatus::overrun;
      block.first_sample += 1;
      block.rows -= 1;
      block.counts.erase(block.counts.begin(), block.counts.begin() + 2);
    }
    return true;
  }

  WatchedOutput watched;
  Fault fault = Fault::none;
  int fault_at = 0;           // read
  int deaf = 0;               // calls of go_to that fail
  double steepest_go_to = 0;  // V/m/s
  double monitor_gain = 200;  // V/m per count
  std::size_t block_rows = 64;
  std::int16_t displacement = 0;  // counts

 private:
  // Expands pieces the way a driver does that writes every sample to a converter.
  std::size_t play(SampleBlock& block) {
    std::size_t rows = 0;
    const auto row = [&](double level) {
      block.counts.push_back(static_cast<std::int16_t>(std::clamp(level / monitor_gain, -32768.0, 32767.0)));
      block.counts.push_back(displacement);
      ++rows;
    };
    if (row_ == 0) row(watched.level());
    while (rows < block_rows) {
      const auto piece = source_->next(block_rows - rows);
      if (piece.samples == 0) break;
      EXPECT_LE(piece.samples, block_rows - rows);
      const double from = watched.level();
      for (std::uint64_t i = 1; i <= piece.samples; ++i) {
        const double share = static_cast<double>(i) / static_cast<double>(piece.samples);
        watched.put(i == piece.samples ? piece.level : from + (piece.level - from) * share, 1 / rate_);
        row(watched.level());
      }
    }
    return rows;
  }

  LevelSource* source_ = nullptr;
  double rate_ = 1;
  std::uint64_t row_ = 0;
  int reads_ = 0;
};

}  // namespace ferrobench::daq

// A bench that has measured already: the guard plays the recorded command, the device answers with what was
// recorded, row by row, with the events and block statuses where they happened.
//
// A level that is not the recorded one (a stop on the way, a program of another origin) has no answer: from
// that row on the rows are gaps, never invented.
#pragma once

#include <chrono>

#include "daq/replay/replay_source.h"

namespace ferrobench::daq {

class ReplayDevice final : public Device {
 public:
  // `config.file` is only a name here.
  ReplayDevice(recordings::Recording recording, const ReplayConfig& config);
  // `json`: a ReplayConfig. Throws Error(invalid_params | not_found | bad_recording).
  static std::unique_ptr<Device> open(const nlohmann::json& json);

  const ReplaySource& source() const { return source_; }
  bool measures() const override { return false; }
  nlohmann::json info() const override;
  std::vector<recordings::RawColumn> columns() const override;
  std::vector<recordings::Channel> signals() const override;
  std::array<std::optional<double>, 5> noise() const override { return source_.recording().noise; }
  nlohmann::json model() const override { return source_.recording().header.model; }
  OutputRange output_range() const override { return {-1e9, 1e9}; }
  double scan_rate(double asked) const override;
  double output() const override { return level_; }
  void go_to(double level, double slew) override;
  void start(double rate, LevelSource& levels) override;
  bool read(SampleBlock& block) override;

 private:
  void pull();
  void answer(SampleBlock& block);
  std::uint64_t add_events(SampleBlock& block, std::uint64_t end);
  void forget(SampleBlock& block, ReplaySource::Known known) const;
  void copy(SampleBlock& block) const;

  ReplayConfig config_;
  ReplaySource source_;
  nlohmann::json origin_;
  std::vector<std::uint64_t> event_rows_;  // where each event is told, rising
  double level_ = 0;

  LevelSource* levels_ = nullptr;
  std::uint64_t row_ = 0;     // the next one to give
  std::uint64_t pulled_ = 0;  // rows whose level has gone out
  std::uint64_t left_ = 0;    // first row off the recorded command
  bool dry_ = false;          // the levels are over
  std::size_t event_ = 0, stretch_ = 0;
  BlockStatus last_status_ = BlockStatus::ok;
  std::chrono::steady_clock::time_point start_, due_;
};

// What the device plays, if it is a replay; null for one that measures.
const ReplaySource* replay_source(const Device& device);

}  // namespace ferrobench::daq

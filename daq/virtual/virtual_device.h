// A bench without hardware: guarded pieces -> model -> sensors -> 16-bit counts, at a true scan rate.
//
// The specimen is poled towards + (+180) when the device is opened, or has the past of its configuration, and
// keeps its state from run to run. Its time goes on in go_to() and while rows are taken, in between it rests.
// The model is advanced in chunks that depend on the scan rate only, so real and fast clock, and any block
// size of a reader, give the same counts.
#pragma once

#include <chrono>
#include <memory>

#include "daq/device.h"
#include "daq/virtual/config.h"
#include "model/simulator.h"

namespace ferrobench::daq {

class VirtualDevice final : public Device {
 public:
  static constexpr double min_aggregate_rate = 1;      // S/s over all columns
  static constexpr double max_aggregate_rate = 500e3;  // S/s over all columns

  // `config.model` is not looked at.
  VirtualDevice(const model::Model& model, const VirtualConfig& config);
  // Throws Error(invalid_params | not_found | bad_model).
  static std::unique_ptr<Device> open(const nlohmann::json& config);
  static void check(const nlohmann::json& config);  // throws the same

  nlohmann::json info() const override;
  std::vector<recordings::RawColumn> columns() const override;
  std::array<std::optional<double>, 5> noise() const override;
  nlohmann::json model() const override { return model::to_json(model_); }
  OutputRange output_range() const override { return {-config_.field_range, config_.field_range}; }
  protocols::Past past() const override;
  double scan_rate(double asked) const override;
  double output() const override { return level_; }
  void go_to(double level, double slew) override;
  void start(double rate, LevelSource& source) override;
  bool read(SampleBlock& block) override;

 private:
  using Seconds = std::chrono::duration<double>;

  void remember(double level, double seconds);
  void fill_chunk();
  void play(const LinearPiece& piece, std::size_t at);
  void convert(SampleBlock& block);

  model::Model model_;
  VirtualConfig config_;
  std::vector<Converter> converters_;  // one per column
  model::Simulator simulator_;
  double level_ = 0;
  // Where the output has gone since the device was opened: the ends of its straight lines. More than a past
  // can have are no longer told.
  std::vector<protocols::VisitedLevel> visited_;
  double slew_ = 0;  // V/m/s, of the last of them

  LevelSource* source_ = nullptr;
  double rate_ = 0;
  std::uint64_t row_ = 0;  // first of the chunk
  std::size_t rows_ = 0;   // of the chunk, 0: to be filled
  std::chrono::steady_clock::time_point start_, due_;
  std::vector<double> times_;
  std::array<std::vector<double>, 5> values_;  // by Channel
  std::array<double, 5> last_{};               // where the specimen is now
};

}  // namespace ferrobench::daq

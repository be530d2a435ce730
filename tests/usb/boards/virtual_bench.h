// A whole bench on the unit's terminals: amplifier, specimen (a model) and sensors, in volts.
//
//   amplifier:  V = gain * AO0, within +-range, reached linearly in rise_time after each step; 0 V unless
//   enabled specimen:   E = V / layer thickness, through the model sensors:    volts = 10 V * (gain * value +
//   offset) / range + noise, with value, range and errors of each
//               sensor in SI as the virtual device has them
//
// The field sensor is the amplifier's monitor. The noise is a function of (seed, channel, conversion).
#pragma once

#include <array>
#include <memory>
#include <optional>
#include <string>

#include "daq/virtual/config.h"
#include "daq/virtual/noise.h"
#include "model/simulator.h"
#include "unit/board.h"

namespace ferrobench::emulator {

// Coarser than the virtual device's: it keeps up with a unit that sets its output step by step.
inline daq::VirtualConfig quick_specimen() {
  daq::VirtualConfig out;
  out.tolerance = 1e-4;
  out.domains = 0;
  return out;
}

struct BenchConfig {
  daq::VirtualConfig specimen = quick_specimen();  // field_range is not looked at: the amplifier has its own
  double amplifier_gain = 20;                      // V/V
  double amplifier_range = 200;                    // V, to both sides
  double rise_time = 20e-6;                        // s
  // Input channels of field, charge, displacement, force, and of a marker with a steady voltage.
  std::int64_t field_channel = 0, charge_channel = 1, displacement_channel = 2, force_channel = 3;
  std::int64_t marker_channel = 4;
  double marker_level = 7.5;     // V
  double marker_noise = 0.5e-3;  // V
  // The specimen is mounted at the first conversion or field, as the virtual device has it. Else it may have
  // waited long for its first field, and depoled under its prestress meanwhile.
  bool fresh = false;
  // Digital lines: the amplifier works only while the unit drives `enable_line` high, and holds
  // `interlock_line` high while its interlock is closed. Absent: not wired, always on.
  std::optional<std::int64_t> enable_line, interlock_line;
};

template <class Visitor>
void describe(Visitor& visit, BenchConfig& c) {
  visit("specimen", c.specimen, {.doc = "model, seed and sensors, as of the virtual device"});
  visit("amplifier_gain", c.amplifier_gain, {.unit = "V/V", .min = -1000, .max = 1000});
  visit("amplifier_range", c.amplifier_range, {.unit = "V", .min = 0, .exclusive_min = true});
  visit("rise_time", c.rise_time, {.unit = "s", .min = 1e-7, .max = 1});
  visit("field_channel", c.field_channel, {.min = 0, .max = 15});
  visit("charge_channel", c.charge_channel, {.min = 0, .max = 15});
  visit("displacement_channel", c.displacement_channel, {.min = 0, .max = 15});
  visit("force_channel", c.force_channel, {.min = 0, .max = 15});
  visit("marker_channel", c.marker_channel, {.min = 0, .max = 15});
  visit("marker_level", c.marker_level, {.unit = "V", .min = -10, .max = 10});
  visit("marker_noise", c.marker_noise, {.unit = "V", .min = 0});
  visit("fresh", c.fresh,
        {.doc = "the specimen's time begins with the first conversion of an input, or the first field"});
  visit("enable_line", c.enable_line, {.min = 0, .max = 7});
  visit("interlock_line", c.interlock_line, {.min = 0, .max = 7});
}

// Throws Error(invalid_params | not_found | bad_model).
BenchConfig bench_config_from_json(const nlohmann::json& json);

// The configuration of the bench's USB device that fits this wiring: what a user of a real bench writes.
nlohmann::json device_config(const BenchConfig& config);

class VirtualBench final : public Board {
 public:
  explicit VirtualBench(const BenchConfig& config);

  const model::Model& model() const { return model_; }
  // What turns volts into SI: value = volts * range / 10 V, by recordings::Channel.
  const std::array<daq::Sensor, 5>& sensors() const { return sensors_; }
  double amplifier_voltage() const { return level_; }  // V, now
  // An opened interlock takes the amplifier to 0 V until it is closed.
  void set_interlock(Ticks time, bool closed);

  void output(Ticks time, unsigned channel, double volts) override;
  double input(Ticks time, const AnalogInput& input) override;
  void digital_out(Ticks time, std::uint8_t levels, std::uint8_t driven) override;
  std::uint8_t digital_in(Ticks time) override;

 private:
  void advance(Ticks to);
  void play(Ticks to, double level);
  void retarget();

  BenchConfig config_;
  model::Model model_;
  std::array<daq::Sensor, 5> sensors_;
  model::Simulator simulator_;
  daq::Noise marker_noise_;
  std::array<std::unique_ptr<daq::Noise>, 5> noise_;
  std::array<std::uint64_t, 6> conversions_{};  // by Channel, the marker's last
  std::array<double, 5> values_{};              // SI, now, by Channel
  Ticks now_ = 0, ramp_end_ = 0, rise_ = 0;
  double command_ = 0;  // V, at AO0
  double level_ = 0;    // V, at the amplifier's output
  double target_ = 0;
  bool enabled_, interlock_closed_ = true;
  bool unmounted_;
};

}  // namespace ferrobench::emulator

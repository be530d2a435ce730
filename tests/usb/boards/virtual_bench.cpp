#include "boards/virtual_bench.h"

#include <algorithm>
#include <cmath>

namespace ferrobench::emulator {

using recordings::Channel;

namespace {

constexpr double sensor_full_scale = 10;  // V

constexpr std::size_t at(Channel channel) {
  return static_cast<std::size_t>(channel);
}
constexpr std::size_t marker = 5;

daq::VirtualConfig with_range(const BenchConfig& config, const model::Model& model) {
  daq::VirtualConfig specimen = config.specimen;
  specimen.field_range = config.amplifier_range / model.actuator.layer_thickness;
  return specimen;
}

}  // namespace

BenchConfig bench_config_from_json(const nlohmann::json& json) {
  return parse<BenchConfig>(json.is_null() ? nlohmann::json::object() : json, ErrorCode::invalid_params,
                            "the emulated bench's configuration");
}

nlohmann::json device_config(const BenchConfig& config) {
  const auto model = daq::model_of(config.specimen);
  const auto sensors = daq::sensors_of(with_range(config, model), model);
  const auto& actuator = model.actuator;
  const auto& field = sensors.at(at(Channel::field));
  const auto input = [&](Channel channel, std::int64_t terminal) {
    const auto& sensor = sensors.at(at(channel));
    return nlohmann::json{{"channel", terminal},
                          {"noise", sensor.noise},
                          {"sensitivity", sensor_full_scale / sensor.range},
                          {"offset", sensor_full_scale * sensor.offset / sensor.range}};
  };
  // Neither the amplifier's current nor its slew are limited here.
  nlohmann::json amplifier{{"gain", config.amplifier_gain},
                           {"voltage_min", -config.amplifier_range},
                           {"voltage_max", config.amplifier_range},
                           {"monitor_ratio", field.range * actuator.layer_thickness / sensor_full_scale},
                           {"current_limit", 1000},
                           {"slew_limit", config.amplifier_range / config.rise_time},
                           {"stop_slew", config.amplifier_range}};
  if (config.enable_line) amplifier["enable_bit"] = *config.enable_line;
  if (config.interlock_line) amplifier["interlock_bit"] = *config.interlock_line;
  return {{"amplifier", std::move(amplifier)},
          {"specimen",
           {{"name", model.name},
            {"length", actuator.length},
            {"area", actuator.area},
            {"layer_thickness", actuator.layer_thickness},
            {"layer_count", actuator.layer_count},
            {"capacitance", sensors.at(at(Channel::charge)).range / config.amplifier_range}}},
          {"load", {{"prestress", model.load.prestress}, {"spring_stiffness", model.load.spring_stiffness}}},
          {"field", {{"channel", config.field_channel}, {"noise", field.noise}}},
          {"charge", input(Channel::charge, config.charge_channel)},
          {"displacement", input(Channel::displacement, config.displacement_channel)},
          {"force", input(Channel::force, config.force_channel)},
          {"marker", {{"channel", config.marker_channel}, {"level", config.marker_level}}},
          {"monitor_check",
           {{"tolerance", 0.01 * config.amplifier_range / actuator.layer_thickness}, {"delay", 0.002}}}};
}

VirtualBench::VirtualBench(const BenchConfig& config)
    : config_(config),
      model_(daq::model_of(config.specimen)),
      sensors_(daq::sensors_of(with_range(config, model_), model_)),
      simulator_(model_, {.tolerance = config.specimen.tolerance,
                          .domains = static_cast<int>(config.specimen.domains)}),
      marker_noise_(static_cast<std::uint64_t>(config.specimen.seed), marker),
      rise_(static_cast<Ticks>(std::llround(config.rise_time * static_cast<double>(ticks_per_second)))),
      enabled_(!config.enable_line),
      unmounted_(config.fresh) {
  for (std::size_t c = 0; c < noise_.size(); ++c)
    noise_.at(c) = std::make_unique<daq::Noise>(static_cast<std::uint64_t>(config.specimen.seed), c);
  simulator_.start(0);
  play(1, 0);
}

void VirtualBench::play(Ticks to, double level) {
  const double duration = static_cast<double>(to - now_) / static_cast<double>(ticks_per_second);
  const double end = simulator_.time() + duration;
  model::ChannelSpans out;
  out.field = std::span(&values_[at(Channel::field)], 1);
  out.charge = std::span(&values_[at(Channel::charge)], 1);
  out.displacement = std::span(&values_[at(Channel::displacement)], 1);
  out.force = std::span(&values_[at(Channel::force)], 1);
  simulator_.play(duration, level / model_.actuator.layer_thickness, std::span(&end, 1), out);
  now_ = to;
  level_ = level;
}

void VirtualBench::advance(Ticks to) {
  if (unmounted_) now_ = to;
  if (now_ < ramp_end_ && to > now_) {
    const Ticks end = std::min(to, ramp_end_);
    const double share = static_cast<double>(end - now_) / static_cast<double>(ramp_end_ - now_);
    play(end, end == ramp_end_ ? target_ : level_ + share * (target_ - level_));
  }
  if (to > now_) play(to, level_);
}

void VirtualBench::retarget() {
  const double wanted = enabled_ && interlock_closed_ ? config_.amplifier_gain * command_ : 0;
  target_ = std::clamp(wanted, -config_.amplifier_range, config_.amplifier_range);
  constexpr double hardly = 0.01;  // of the range: more than an uncalibrated zero
  if (std::abs(target_) > hardly * config_.amplifier_range) unmounted_ = false;
  ramp_end_ = target_ == level_ ? now_ : now_ + std::max<Ticks>(rise_, 1);
}

void VirtualBench::output(Ticks time, unsigned channel, double volts) {
  if (channel != 0) return;
  advance(time);
  command_ = volts;
  retarget();
}

void VirtualBench::digital_out(Ticks time, std::uint8_t levels, std::uint8_t driven) {
  if (!config_.enable_line) return;
  advance(time);
  enabled_ = (static_cast<unsigned>(levels & driven) >> *config_.enable_line & 1U) != 0;
  retarget();
}

std::uint8_t VirtualBench::digital_in(Ticks) {
  if (!config_.interlock_line || !interlock_closed_) return 0;
  return static_cast<std::uint8_t>(1U << *config_.interlock_line);
}

void VirtualBench::set_interlock(Ticks time, bool closed) {
  advance(time);
  interlock_closed_ = closed;
  retarget();
}

double VirtualBench::input(Ticks time, const AnalogInput& input) {
  double volts = 0;
  if (input.channel == config_.marker_channel) {
    // No look at the specimen, which stays unmounted: a unit is opened with a conversion that is thrown away.
    volts = config_.marker_level;
    marker_noise_.add(conversions_[marker]++, config_.marker_noise, std::span(&volts, 1));
    return volts;
  }
  const std::array wired{std::pair{Channel::field, config_.field_channel},
                         std::pair{Channel::charge, config_.charge_channel},
                         std::pair{Channel::displacement, config_.displacement_channel},
                         std::pair{Channel::force, config_.force_channel}};
  const auto* found =
      std::find_if(wired.begin(), wired.end(), [&](const auto& w) { return w.second == input.channel; });
  if (found == wired.end()) return 0;
  advance(time);
  unmounted_ = false;
  const auto c = at(found->first);
  const daq::Sensor& sensor = sensors_.at(c);
  double value = sensor.gain * values_.at(c) + sensor.offset;
  noise_.at(c)->add(conversions_.at(c)++, sensor.noise, std::span(&value, 1));
  return sensor_full_scale * value / sensor.range;
}

}  // namespace ferrobench::emulator

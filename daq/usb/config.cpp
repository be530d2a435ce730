#include "daq/usb/config.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>

#include "base/text_file.h"
#include "daq/guard/limits.h"
#include "daq/usb/calibration.h"

namespace ferrobench::daq::usb {

std::span<const std::pair<Wiring, std::string_view>> enum_names(Wiring) {
  static constexpr std::array<std::pair<Wiring, std::string_view>, 2> names{
      {{Wiring::differential, "differential"}, {Wiring::single_ended, "single_ended"}}};
  return names;
}

std::span<const std::pair<Polarity, std::string_view>> enum_names(Polarity) {
  static constexpr std::array<std::pair<Polarity, std::string_view>, 2> names{
      {{Polarity::normal, "normal"}, {Polarity::inverted, "inverted"}}};
  return names;
}

std::span<const std::pair<StartMode, std::string_view>> enum_names(StartMode) {
  static constexpr std::array<std::pair<StartMode, std::string_view>, 2> names{
      {{StartMode::trigger, "trigger"}, {StartMode::clock, "clock"}}};
  return names;
}

std::span<const std::pair<TickOrder, std::string_view>> enum_names(TickOrder) {
  static constexpr std::array<std::pair<TickOrder, std::string_view>, 2> names{
      {{TickOrder::before_update, "before_update"}, {TickOrder::after_update, "after_update"}}};
  return names;
}

namespace {

using Problems = std::vector<Problem>;

// What fields.h cannot see: values against each other.
class Checker {
 public:
  explicit Checker(const UsbConfig& config) : config_(config) {}

  Problems run() {
    input("/field", config_.field.channel, config_.field.range);
    if (config_.charge) charge(*config_.charge);
    if (config_.displacement) sensor("/displacement", *config_.displacement);
    if (config_.force) sensor("/force", *config_.force);
    if (config_.marker) marker(*config_.marker);
    if (!config_.marker && !config_.monitor_check)
      report("/marker", "or monitor_check is needed: without either, channels that changed places would pass",
             nullptr, nullptr, "wire a known voltage to an input and name it as marker");
    amplifier();
    return std::move(problems_);
  }

 private:
  void report(std::string path, std::string message, nlohmann::json given, nlohmann::json allowed,
              std::string hint, std::string unit = {}) {
    problems_.push_back({.path = std::move(path),
                         .message = std::move(message),
                         .given = std::move(given),
                         .allowed = std::move(allowed),
                         .unit = std::move(unit),
                         .hint = std::move(hint)});
  }

  void input(const std::string& path, std::int64_t channel, double range) {
    const std::int64_t last = config_.wiring == Wiring::differential ? 7 : 15;
    if (channel > last)
      report(path + "/channel", "is not there in this wiring", channel, {{"from", 0}, {"to", last}},
             "choose another input, or wiring single_ended");
    if (std::ranges::find(channels_, channel) != channels_.end())
      report(path + "/channel", "is taken by another signal", channel, nullptr,
             "give every signal its own input");
    channels_.push_back(channel);
    if (range != 10 && range != 5 && range != 2 && range != 1)
      report(path + "/range", "is no range of the converter", range, {10, 5, 2, 1}, "", "V");
  }

  void charge(const ChargeInput& c) {
    input("/charge", c.channel, c.range);
    if (c.sensitivity.has_value() == c.capacitance.has_value())
      report("/charge", "needs either sensitivity or capacitance", nullptr, nullptr,
             "sensitivity for a charge amplifier, capacitance for a Sawyer-Tower circuit");
    if (c.sensitivity && *c.sensitivity == 0)
      report("/charge/sensitivity", "must not be zero", 0, nullptr, "", "V/C");
    if (c.capacitance && !(*c.capacitance > 0))
      report("/charge/capacitance", "must be positive", *c.capacitance, nullptr, "", "F");
    const double volts_per_coulomb = c.sensitivity.value_or(c.capacitance ? 1 / *c.capacitance : 0);
    if (config_.specimen.max_charge && std::isfinite(volts_per_coulomb)) {
      const double volts = std::abs(volts_per_coulomb) * *config_.specimen.max_charge + std::abs(c.offset);
      if (volts > c.range)
        report("/charge/range", "is too small for max_charge of the specimen", c.range, {{"from", volts}},
               "choose a larger range or a larger capacitance", "V");
    }
  }

  void sensor(const std::string& path, const SensorInput& s) {
    input(path, s.channel, s.range);
    if (s.sensitivity.has_value() == !s.table.empty())
      report(path, "needs either sensitivity or table", nullptr, nullptr, "");
    if (s.sensitivity && *s.sensitivity == 0)
      report(path + "/sensitivity", "must not be zero", 0, nullptr, "");
    if (s.table.empty()) return;
    if (s.offset != 0) report(path + "/offset", "has no meaning with a table", s.offset, 0, "");
    if (s.table.size() < 2 || s.table.size() > 1000)
      return report(path + "/table", "has the wrong number of points", s.table.size(),
                    {{"from", 2}, {"to", 1000}}, "");
    const bool rising = s.table[1].value > s.table[0].value;
    for (std::size_t i = 1; i < s.table.size(); ++i) {
      const auto at = path + "/table/" + std::to_string(i);
      if (!(s.table[i].volts > s.table[i - 1].volts))
        report(at + "/volts", "must be above the point before", s.table[i].volts, nullptr, "sort the points",
               "V");
      if (s.table[i].value == s.table[i - 1].value || (s.table[i].value > s.table[i - 1].value) != rising)
        report(at + "/value", "must go on rising or falling", s.table[i].value, nullptr,
               "a table that turns back has no inverse");
    }
  }

  void marker(const MarkerConfig& m) {
    input("/marker", m.channel, m.range);
    if (std::abs(m.level) + m.tolerance >= m.range)
      report("/marker/level", "with its tolerance is outside the range", m.level,
             {{"below", m.range - m.tolerance}}, "choose a larger range", "V");
    if (std::abs(m.level) <= m.tolerance)
      report("/marker/level", "is zero within its tolerance, as any idle input is", m.level, nullptr,
             "use a voltage that no other signal has", "V");
  }

  void amplifier() {
    const auto& a = config_.amplifier;
    if (!(a.voltage_max > a.voltage_min))
      report("/amplifier/voltage_max", "must be above voltage_min", a.voltage_max, {{"above", a.voltage_min}},
             "", "V");
    if (a.monitor_ratio == 0) return report("/amplifier/monitor_ratio", "must not be zero", 0, nullptr, "");
    const double needed = std::max(std::abs(a.voltage_min), a.voltage_max) / std::abs(a.monitor_ratio) +
                          std::abs(a.monitor_offset);
    if (needed > config_.field.range * (1 + 1e-9))
      report("/field/range", "is too small for the monitor at full voltage", config_.field.range,
             {{"from", needed}}, "choose a larger range", "V");
    if (a.stop_slew > a.slew_limit)
      report("/amplifier/stop_slew", "is above slew_limit", a.stop_slew, {{"to", a.slew_limit}}, "", "V/s");
    const double full = std::max(-a.voltage_min, a.voltage_max);
    const double slowest = std::min(a.slew_limit, full / usual_stop_time);
    if (a.stop_slew > 0 && a.stop_slew < slowest * (1 - 1e-9))
      report("/amplifier/stop_slew", "would keep the voltage up for longer than 10 s", a.stop_slew,
             {{"from", slowest}}, "raise it, or leave it out: 1 s from full voltage", "V/s");
    // DIO0 is the trigger's.
    const bool triggered = config_.start.mode == StartMode::trigger;
    for (const auto& [name, bit] :
         {std::pair{"enable_bit", a.enable_bit}, std::pair{"interlock_bit", a.interlock_bit}})
      if (triggered && bit && *bit == 0)
        report(std::string("/amplifier/") + name, "is DIO0, which gives the trigger", 0,
               {{"from", 1}, {"to", 7}}, "use another line");
    if (a.enable_bit && a.interlock_bit && *a.enable_bit == *a.interlock_bit)
      report("/amplifier/interlock_bit", "is enable_bit, too", *a.interlock_bit, nullptr, "use another line");
  }

  const UsbConfig& config_;
  std::vector<std::int64_t> channels_;
  Problems problems_;
};

}  // namespace

UsbConfig usb_config_from_json(const nlohmann::json& json) {
  auto config = parse<UsbConfig>(json.is_null() ? nlohmann::json::object() : json, ErrorCode::invalid_params,
                                 "the USB device's configuration");
  if (auto problems = Checker(config).run(); !problems.empty())
    throw Error(ErrorCode::invalid_params, "the USB device's configuration is not valid",
                std::move(problems));
  auto& a = config.amplifier;
  if (a.stop_slew == 0) a.stop_slew = std::min(a.slew_limit, std::max(-a.voltage_min, a.voltage_max) / 1.0);
  return config;
}

nlohmann::json load_json(const std::string& path) {
  constexpr std::size_t most_bytes = 1u << 20;
  const auto text = read_text_file(path, most_bytes, ErrorCode::invalid_params, Pipes::read);
  auto json = parse_json_text(text, ErrorCode::invalid_params, "the device's configuration", most_bytes);
  if (json.is_object() && json.contains("fpga_image") && json["fpga_image"].is_string()) {
    const auto& image = json["fpga_image"].get_ref<const std::string&>();
    if (!image.empty())
      json["fpga_image"] =
          (std::filesystem::absolute(path).parent_path() / image).lexically_normal().string();
  }
  return json;
}

UsbConfig load(const std::string& path) {
  return usb_config_from_json(load_json(path));
}

recordings::Specimen to_recording(const SpecimenConfig& s) {
  return {s.name, s.length, s.area, s.layer_thickness, s.layer_count};
}

recordings::LoadCase to_recording(const LoadConfig& l) {
  return {l.spring_stiffness, l.prestress};
}

}  // namespace ferrobench::daq::usb

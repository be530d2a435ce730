#include "daq/usb/inputs.h"

#include <algorithm>
#include <cmath>

namespace ferrobench::daq::usb {

using recordings::Channel;

namespace {

constexpr int code_count = 65536;

InputRange range_of(double volts) {
  return volts == 10  ? InputRange::v10
         : volts == 5 ? InputRange::v5
         : volts == 2 ? InputRange::v2
                      : InputRange::v1;
}

QueueElement element_of(std::int64_t channel, double range, Wiring wiring) {
  return {.channel = static_cast<int>(channel),
          .range = range_of(range),
          .mode = wiring == Wiring::differential ? InputMode::differential : InputMode::single_ended};
}

// SI value = (volts - zero) per_volt.
void scale(InputColumn& c, const Calibration& calibration, double per_volt, double zero) {
  const auto volts = [&](int code) { return calibration.volts(c.element.range, code); };
  // Over all codes: a step of one would carry its rounding to the ends.
  c.column.gain = (volts(code_count - 1) - volts(0)) / (code_count - 1) * per_volt;
  c.column.offset = (volts(code_count / 2) - zero) * per_volt;
}

double interpolate(const std::vector<TablePoint>& table, double volts) {
  const auto after = std::clamp(std::ranges::lower_bound(table, volts, {}, &TablePoint::volts),
                                table.begin() + 1, table.end() - 1);
  const auto before = after - 1;
  const double share = std::clamp((volts - before->volts) / (after->volts - before->volts), 0.0, 1.0);
  return before->value + share * (after->value - before->value);
}

void linearize(InputColumn& c, const Calibration& calibration, const std::vector<TablePoint>& table) {
  const double full = full_scale(c.element.range);
  const double a = interpolate(table, -full);
  const double b = interpolate(table, full);
  constexpr double top = 32767;
  c.column.offset = (a + b) / 2;
  c.column.gain = std::abs(b - a) / (2 * top);
  c.by_code.resize(code_count);
  int lowest = code_count, highest = -1;
  for (int code = 0; code < code_count; ++code) {
    const double volts = calibration.volts(c.element.range, code);
    const double count = (interpolate(table, volts) - c.column.offset) / c.column.gain;
    c.by_code[static_cast<std::size_t>(code)] =
        static_cast<std::int16_t>(std::clamp(std::round(count), -top, top));
    if (volts < table.front().volts || volts > table.back().volts) continue;
    lowest = std::min(lowest, code);
    highest = std::max(highest, code);
  }
  c.lowest_code = std::max(c.lowest_code, lowest);
  c.highest_code = std::min(c.highest_code, highest);
}

InputColumn column(Channel channel, const Input& input, Wiring wiring) {
  InputColumn out;
  out.column.channel = channel;
  out.element = element_of(input.channel, input.range, wiring);
  out.noise = input.noise;
  out.gain_uncertainty = input.gain_uncertainty;
  return out;
}

InputColumn sensor_column(Channel channel, const SensorInput& sensor, const UsbConfig& config,
                          const Calibration& calibration) {
  auto out = column(channel, sensor, config.wiring);
  if (sensor.table.empty()) {
    scale(out, calibration, 1 / *sensor.sensitivity, sensor.offset);
  } else {
    linearize(out, calibration, sensor.table);
  }
  return out;
}

}  // namespace

Inputs::Inputs(const UsbConfig& config, const Calibration& calibration) {
  columns_.push_back(column(Channel::field, config.field, config.wiring));
  scale(columns_.back(), calibration, config.amplifier.monitor_ratio / config.specimen.layer_thickness,
        config.amplifier.monitor_offset);
  if (const auto& charge = config.charge) {
    columns_.push_back(column(Channel::charge, *charge, config.wiring));
    scale(columns_.back(), calibration, charge->capacitance ? *charge->capacitance : 1 / *charge->sensitivity,
          charge->offset);
  }
  if (config.displacement)
    columns_.push_back(sensor_column(Channel::displacement, *config.displacement, config, calibration));
  if (config.force) columns_.push_back(sensor_column(Channel::force, *config.force, config, calibration));
  for (const auto& c : columns_) queue_.push_back(c.element);
  if (!config.marker) return;

  const auto& m = *config.marker;
  const auto element = element_of(m.channel, m.range, config.wiring);
  const double zero = calibration.volts(element.range, 0);
  const double per_code = calibration.volts(element.range, 1) - zero;
  marker_ = Marker{.position = queue_.size(),
                   .lowest_code = static_cast<int>(std::floor((m.level - m.tolerance - zero) / per_code)),
                   .highest_code = static_cast<int>(std::ceil((m.level + m.tolerance - zero) / per_code))};
  queue_.push_back(element);
}

}  // namespace ferrobench::daq::usb

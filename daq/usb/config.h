// What is wired to a unit: the amplifier on its output, the sensors on its inputs, the specimen between them.
// One JSON file holds it; json_schema<UsbConfig>() describes it.
//
// Field and amplifier: field [V/m] = polarity gain [V/V] output [V] / layer_thickness [m]. Positive is along
// the poling direction.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/fields.h"
#include "base/load_range.h"
#include "recordings/format/recording.h"

namespace ferrobench::daq::usb {

enum class Wiring { differential, single_ended };
std::span<const std::pair<Wiring, std::string_view>> enum_names(Wiring);

enum class Polarity { normal, inverted };
std::span<const std::pair<Polarity, std::string_view>> enum_names(Polarity);

// trigger: both scans wait for one edge, which DIO0 gives over a wire to TRIG. clock: the output's clock,
// over a wire from its pin to the input's, makes every scan of the inputs.
enum class StartMode { trigger, clock };
std::span<const std::pair<StartMode, std::string_view>> enum_names(StartMode);

// What an input converted at a tick sees of the output that changes at the same tick.
enum class TickOrder { before_update, after_update };
std::span<const std::pair<TickOrder, std::string_view>> enum_names(TickOrder);

struct Input {
  std::int64_t channel = 0;
  double range = 10;                       // V, full scale
  std::optional<double> noise;             // SI, standard deviation
  std::optional<double> gain_uncertainty;  // standard, relative; of the whole way from the quantity to volts
};

struct ChargeInput : Input {
  std::optional<double> sensitivity;  // V/C, charge amplifier
  std::optional<double> capacitance;  // F, Sawyer-Tower: V = Q / C
  double offset = 0;                  // V at zero charge
};

struct TablePoint {
  double volts = 0;
  double value = 0;  // SI
};

struct SensorInput : Input {
  std::optional<double> sensitivity;  // V/m or V/N
  double offset = 0;                  // V at zero
  std::vector<TablePoint> table;      // instead of both
};

struct AmplifierConfig {
  double gain = 0;         // V/V
  double voltage_min = 0;  // V, across the specimen
  double voltage_max = 0;  // V
  Polarity polarity = Polarity::normal;
  double monitor_ratio = 0;   // V across the specimen for 1 V at the monitor
  double monitor_offset = 0;  // V at the monitor at zero field
  double current_limit = 0;   // A
  double slew_limit = 0;      // V/s, across the specimen
  double stop_slew = 0;       // V/s of the driver's own ways to zero; 0: from full voltage in 1 s
  std::optional<std::int64_t> enable_bit;     // DIO, high: on
  std::optional<std::int64_t> interlock_bit;  // DIO, high: closed
};

struct SpecimenConfig {
  std::string name = "specimen";
  double length = 0;           // m
  double area = 0;             // m^2, of one layer's electrode
  double layer_thickness = 0;  // m
  std::int64_t layer_count = 1;
  double capacitance = 0;            // F, dQ/dV at its largest, switching included
  std::optional<double> max_charge;  // C, the largest at the terminals
};

struct LoadConfig {
  double prestress = 0;         // Pa, compressive positive
  double spring_stiffness = 0;  // N/m
};

struct MarkerConfig {
  std::int64_t channel = 0;
  double range = 10;       // V
  double level = 0;        // V
  double tolerance = 0.1;  // V
};

struct MonitorCheck {
  double tolerance = 0;  // V/m
  double delay = 0.001;  // s, by which the monitor may come later
};

struct StartConfig {
  StartMode mode = StartMode::trigger;
  TickOrder tick_order = TickOrder::before_update;
};

struct UsbConfig {
  std::string serial_number;
  std::string fpga_image;
  std::int64_t output_channel = 0;
  Wiring wiring = Wiring::differential;
  double update_rate = 40e3;  // Hz
  double queue_ahead = 0.05;  // s
  AmplifierConfig amplifier;
  SpecimenConfig specimen;
  LoadConfig load;
  Input field;
  std::optional<ChargeInput> charge;
  std::optional<SensorInput> displacement, force;
  std::optional<MarkerConfig> marker;
  std::optional<MonitorCheck> monitor_check;
  StartConfig start;
};

template <class Visitor>
void describe_input(Visitor& visit, Input& i) {
  visit("channel", i.channel,
        {.min = 0, .max = 15, .required = true, .doc = "input; 0 to 7 when wired differentially"});
  visit("range", i.range, {.unit = "V", .doc = "full scale of the converter: 10, 5, 2 or 1"});
  visit("noise", i.noise, {.min = 0, .doc = "standard deviation in SI, where known"});
  visit("gain_uncertainty", i.gain_uncertainty,
        {.min = 0,
         .max = 1,
         .doc = "relative standard uncertainty of the sensor's gain, as its calibration states it (k = 1); "
                "part of the uncertainties in reports"});
}

template <class Visitor>
void describe(Visitor& visit, Input& i) {
  describe_input(visit, i);
}

template <class Visitor>
void describe(Visitor& visit, ChargeInput& c) {
  describe_input(visit, c);
  visit("sensitivity", c.sensitivity,
        {.unit = "V/C", .doc = "of a charge amplifier; negative if it inverts"});
  visit("capacitance", c.capacitance,
        {.unit = "F", .doc = "of a Sawyer-Tower circuit, instead of sensitivity"});
  visit("offset", c.offset, {.unit = "V", .min = -10, .max = 10, .doc = "at zero charge"});
}

template <class Visitor>
void describe(Visitor& visit, TablePoint& p) {
  visit("volts", p.volts, {.unit = "V", .min = -10, .max = 10, .required = true});
  visit("value", p.value, {.required = true, .doc = "in SI: m or N"});
}

template <class Visitor>
void describe(Visitor& visit, SensorInput& s) {
  describe_input(visit, s);
  visit("sensitivity", s.sensitivity, {.doc = "V/m or V/N; negative if it inverts"});
  visit("offset", s.offset, {.unit = "V", .min = -10, .max = 10, .doc = "at zero"});
  visit(
      "table", s.table,
      {.doc = "calibration points instead of sensitivity and offset: volts rising, value rising or falling"});
}

template <class Visitor>
void describe(Visitor& visit, AmplifierConfig& a) {
  visit("gain", a.gain,
        {.unit = "V/V", .min = 0, .max = 1e5, .exclusive_min = true, .required = true, .doc = "magnitude"});
  visit("voltage_min", a.voltage_min,
        {.unit = "V",
         .min = -1e5,
         .max = 0,
         .required = true,
         .doc = "lowest it may give the specimen, positive along the poling direction"});
  visit("voltage_max", a.voltage_max,
        {.unit = "V", .min = 0, .max = 1e5, .required = true, .doc = "highest it may give the specimen"});
  visit("polarity", a.polarity, {.doc = "inverted: a positive field needs a negative voltage at its input"});
  visit("monitor_ratio", a.monitor_ratio,
        {.unit = "V/V",
         .min = -1e6,
         .max = 1e6,
         .required = true,
         .doc = "voltage across the specimen for 1 V at the monitor"});
  visit("monitor_offset", a.monitor_offset,
        {.unit = "V", .min = -10, .max = 10, .doc = "of the monitor at 0 V"});
  visit("current_limit", a.current_limit,
        {.unit = "A", .min = 0, .max = 1e3, .exclusive_min = true, .required = true});
  visit("slew_limit", a.slew_limit,
        {.unit = "V/s",
         .min = 0,
         .max = 1e12,
         .exclusive_min = true,
         .required = true,
         .doc = "of its output"});
  visit("stop_slew", a.stop_slew,
        {.unit = "V/s",
         .min = 0,
         .max = 1e12,
         .doc = "of ways to zero that nobody else sets; 0: 1 s from full"});
  visit("enable_bit", a.enable_bit,
        {.min = 0, .max = 7, .doc = "digital line that switches it on, high: on; absent: none"});
  visit("interlock_bit", a.interlock_bit,
        {.min = 0, .max = 7, .doc = "digital line that is high while the interlock is closed; absent: none"});
}

template <class Visitor>
void describe(Visitor& visit, SpecimenConfig& s) {
  visit("name", s.name, {});
  visit("length", s.length, {.unit = "m", .min = 0, .max = 10, .exclusive_min = true, .required = true});
  visit("area", s.area,
        {.unit = "m^2",
         .min = 0,
         .max = 1,
         .exclusive_min = true,
         .required = true,
         .doc = "electrode of a layer"});
  visit("layer_thickness", s.layer_thickness,
        {.unit = "m", .min = 0, .max = 0.1, .exclusive_min = true, .required = true});
  visit("layer_count", s.layer_count, {.min = 1, .max = 1e6});
  visit("capacitance", s.capacitance,
        {.unit = "F",
         .min = 0,
         .max = 1,
         .exclusive_min = true,
         .required = true,
         .doc = "largest dQ/dV at the terminals, switching included: the amplifier's current comes from it"});
  visit("max_charge", s.max_charge,
        {.unit = "C", .min = 0, .max = 1, .exclusive_min = true, .doc = "largest charge at the terminals"});
}

template <class Visitor>
void describe(Visitor& visit, LoadConfig& l) {
  visit("prestress", l.prestress,
        {.unit = "Pa", .min = prestress_min, .max = prestress_max, .doc = "compressive positive"});
  visit("spring_stiffness", l.spring_stiffness, {.unit = "N/m", .min = 0, .max = spring_stiffness_max});
}

template <class Visitor>
void describe(Visitor& visit, MarkerConfig& m) {
  visit("channel", m.channel,
        {.min = 0, .max = 15, .required = true, .doc = "input that has a known voltage"});
  visit("range", m.range, {.unit = "V", .doc = "full scale of the converter: 10, 5, 2 or 1"});
  visit("level", m.level, {.unit = "V", .min = -10, .max = 10, .required = true, .doc = "its voltage"});
  visit("tolerance", m.tolerance, {.unit = "V", .min = 0, .max = 10, .exclusive_min = true});
}

template <class Visitor>
void describe(Visitor& visit, MonitorCheck& m) {
  visit("tolerance", m.tolerance,
        {.unit = "V/m",
         .min = 0,
         .max = 1e9,
         .exclusive_min = true,
         .required = true,
         .doc = "by which the measured field may differ from the one asked for"});
  visit("delay", m.delay, {.unit = "s", .min = 0, .max = 1, .doc = "by which the monitor may come later"});
}

template <class Visitor>
void describe(Visitor& visit, StartConfig& s) {
  visit("mode", s.mode,
        {.doc = "trigger: a wire from DIO0 to TRIG; clock: a wire from the output's clock to the input's"});
  visit("tick_order", s.tick_order,
        {.doc = "whether an input converted at a tick sees the output before or after its update"});
}

template <class Visitor>
void describe(Visitor& visit, UsbConfig& c) {
  visit("serial_number", c.serial_number, {.doc = "of the unit; \"\": the only one attached"});
  visit("fpga_image", c.fpga_image,
        {.doc = "file of the unit's FPGA image; a relative name starts at the configuration's folder"});
  visit("output_channel", c.output_channel, {.min = 0, .max = 1, .doc = "analog output to the amplifier"});
  visit("wiring", c.wiring, {.doc = "of all inputs"});
  visit("update_rate", c.update_rate,
        {.unit = "Hz",
         .min = 0,
         .max = 500e3,
         .doc = "the output moves at least this often; a slower scan is taken as every n-th of a faster one. "
                "A row is taken before the amplifier has followed its last step: creep after a ramp begins "
                "that late"});
  visit("queue_ahead", c.queue_ahead,
        {.unit = "s", .min = 0.02, .max = 0.5, .doc = "output queued in advance: how long a stop may wait"});
  visit("amplifier", c.amplifier, {.required = true});
  visit("specimen", c.specimen, {.required = true});
  visit("load", c.load, {.doc = "of the specimen"});
  visit("field", c.field, {.unit = "V/m", .required = true, .doc = "the amplifier's monitor"});
  visit("charge", c.charge, {.unit = "C", .doc = "absent: not measured"});
  visit("displacement", c.displacement, {.unit = "m", .doc = "absent: not measured"});
  visit("force", c.force, {.unit = "N", .doc = "absent: not measured"});
  visit("marker", c.marker, {.doc = "a known voltage that proves that no channel took another's place"});
  visit("monitor_check", c.monitor_check,
        {.doc = "the measured field against the one asked for, all the time"});
  visit("start", c.start, {.doc = "how input and output start together"});
}

// Throws Error(invalid_params) with everything wrong with it, by itself and against the rest.
UsbConfig usb_config_from_json(const nlohmann::json& json);
// The file, with paths in it made absolute. Throws Error(io_error | invalid_params).
UsbConfig load(const std::string& path);
// The same, before it is checked: what `--device-config` sends.
nlohmann::json load_json(const std::string& path);

recordings::Specimen to_recording(const SpecimenConfig& specimen);
recordings::LoadCase to_recording(const LoadConfig& load);

}  // namespace ferrobench::daq::usb

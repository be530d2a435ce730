// A recording in memory: what was measured in one run, in SI units. On disk: recordings/file.
#pragma once

#include <array>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "protocols/past.h"

namespace ferrobench::recordings {

struct Specimen {
  std::string name;
  double length = 0;           // m, active
  double area = 0;             // m^2, electrode
  double layer_thickness = 0;  // m
  std::int64_t layer_count = 1;
};

struct LoadCase {
  double spring_stiffness = 0;  // N/m
  double prestress = 0;         // Pa, compressive positive
};

// With the units in the names: {"length_m": ...}.
nlohmann::json to_json(const Specimen& specimen);
nlohmann::json to_json(const LoadCase& load);

// The measured channels, in the order of the file's data group.
enum class Channel { command, field, charge, displacement, force };
inline constexpr std::array<Channel, 5> all_channels{Channel::command, Channel::field, Channel::charge,
                                                     Channel::displacement, Channel::force};
std::string_view channel_name(Channel channel);    // "command", ...
std::string_view channel_unit(Channel channel);    // "V/m", "V/m", "C", "m", "N"
std::string channel_place(Channel channel);        // where the file has it: "/entry/data/field", ...
std::string other_place(const std::string& name);  // "/entry/others/current"

enum class ChargeReference { absolute, first_sample };

// Row of the segment table; samples are half-open.
struct SegmentRow {
  std::int64_t start_sample = 0;
  std::int64_t end_sample = 0;
  std::string kind;  // "ramp" | "hold"
  std::string label;
  double level = 0;  // V/m
  double rate = 0;   // V/m/s
};

struct Event {
  double time = 0;  // s
  std::string kind;
  std::string message;
};

// One column of raw counts: SI value = offset + gain * count.
struct RawColumn {
  Channel channel = Channel::field;
  double gain = 1;
  double offset = 0;
};

struct Raw {
  std::vector<RawColumn> columns;
  std::vector<std::int16_t> counts;  // rows by columns, row after row
};

// A column beside the channels that the source of an import has: current, another tester's averages.
struct ColumnName {
  std::string name;       // "current": small letters, digits and underscores
  std::string unit;       // SI, "" for a number alone
  std::string long_name;  // as people say it
};
struct OtherColumn {
  ColumnName as;
  std::vector<double> values;  // one for each sample
};

// What is known before the first sample.
struct Header {
  std::string title;
  std::string start_time;        // ISO 8601 with zone
  std::string entry_identifier;  // UUID
  std::optional<std::int64_t> run_seed;
  nlohmann::json protocol;  // null if unknown
  nlohmann::json model;     // null if unknown
  nlohmann::json device;    // driver, serial number, ...
  Specimen specimen;
  LoadCase load;
  protocols::Past past;  // of the specimen, before the first sample
  ChargeReference charge_reference = ChargeReference::absolute;
};

struct Recording {
  Header header;
  std::string end_time;
  std::string status = "complete";  // running | complete | aborted | recovered
  std::string reason;
  std::vector<double> time;                                    // s
  std::array<std::optional<std::vector<double>>, 5> channels;  // by Channel; absent if not measured
  std::vector<SegmentRow> segments;
  std::vector<Event> events;
  std::array<std::optional<double>, 5> noise;  // standard deviation in SI, by Channel
  std::optional<Raw> raw;
  std::vector<OtherColumn> others;

  std::size_t size() const { return time.size(); }
  bool has(Channel c) const { return channels[static_cast<std::size_t>(c)].has_value(); }
  const std::vector<double>& at(Channel c) const { return channels[static_cast<std::size_t>(c)].value(); }
  std::vector<double>& set(Channel c) { return channels[static_cast<std::size_t>(c)].emplace(); }
};

}  // namespace ferrobench::recordings

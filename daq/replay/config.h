// How a recording is played again: which part of it, how fast, and read with which calibration.
#pragma once

#include "daq/virtual/config.h"

namespace ferrobench::daq {

// counts: through the scaling, where the file has raw counts. signals: the SI values that the file states.
enum class Played { counts, signals };
std::span<const std::pair<Played, std::string_view>> enum_names(Played);

// SI value = offset + gain * the recorded value.
struct Recalibration {
  double gain = 1;
  double offset = 0;  // SI
  bool changes() const { return gain != 1 || offset != 0; }
};

struct ReplayConfig {
  std::string file{};
  Clock clock = Clock::real;
  double speed = 1;
  std::optional<double> from{}, to{};  // s
  Played played = Played::counts;
  Recalibration field{}, charge{}, displacement{}, force{};
};

template <class Visitor>
void describe(Visitor& visit, Recalibration& r) {
  visit("gain", r.gain, {.min = -1e6, .max = 1e6, .doc = "times the recorded value; not 0"});
  visit("offset", r.offset, {.min = -1e12, .max = 1e12, .doc = "added after, in SI"});
}

template <class Visitor>
void describe(Visitor& visit, ReplayConfig& c) {
  visit("file", c.file, {.required = true, .doc = "the recording; for a daemon its name"});
  visit("clock", c.clock, {.doc = "real: rows come at their time over speed; fast: as fast as they can"});
  visit("speed", c.speed, {.min = 1, .max = 1e6, .doc = "times the recorded speed, where the clock is real"});
  visit("from", c.from, {.unit = "s", .doc = "start of the part to play; absent: the recording's"});
  visit("to", c.to, {.unit = "s", .doc = "end of the part to play; absent: the recording's"});
  visit("played", c.played,
        {.doc = "counts: raw counts through the scaling, where the file has them; signals: its SI values"});
  visit("field", c.field, {.unit = "V/m", .doc = "change of its calibration"});
  visit("charge", c.charge, {.unit = "C", .doc = "change of its calibration"});
  visit("displacement", c.displacement, {.unit = "m", .doc = "change of its calibration"});
  visit("force", c.force, {.unit = "N", .doc = "change of its calibration"});
}

// Throws Error(invalid_params).
ReplayConfig replay_config_from_json(const nlohmann::json& json);
// By Channel; the command has none.
std::array<Recalibration, 5> recalibrations(const ReplayConfig& config);

}  // namespace ferrobench::daq

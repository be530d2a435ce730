// The segments a program is made of, as they stand in JSON. Levels and rates are in the unit of the file
// (kV/mm or V, and the same per second); times in s. In place of a number "$name" takes the value of a
// parameter, "-$name" its negative. Every segment begins at the level where the one before it ended.
//
// A move to the level where the program already is takes no time and leaves no row in the segment table,
// except where the time was asked for: then it is a hold.
#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <variant>
#include <vector>

#include "base/fields.h"
#include "protocols/csv.h"
#include "protocols/recorded_rows.h"

namespace ferrobench::protocols {

inline constexpr std::string_view level_unit = "kV/mm or V";
inline constexpr std::string_view rate_unit = "kV/mm/s or V/s";

constexpr FieldInfo level_info(std::string_view doc, bool required = false) {
  return {.unit = level_unit, .min = -1e6, .max = 1e6, .required = required, .doc = doc};
}
constexpr FieldInfo rate_info(std::string_view doc, bool required = false) {
  return {.unit = rate_unit, .min = 1e-9, .max = 1e9, .required = required, .doc = doc};
}
constexpr FieldInfo time_info(std::string_view doc, bool required = false) {
  return {.unit = "s", .min = 0, .max = 1e7, .required = required, .doc = doc};
}
constexpr FieldInfo amplitude_info(std::string_view doc) {
  return {.unit = level_unit, .min = 0, .max = 1e6, .exclusive_min = true, .required = true, .doc = doc};
}
constexpr FieldInfo frequency_info(std::string_view doc, bool required = false) {
  return {.unit = "Hz", .min = 1e-9, .max = 1e6, .required = required, .doc = doc};
}

// One straight line to a level: give `rate` or `time`.
struct Ramp {
  static constexpr std::string_view kind = "ramp";
  double to = 0;
  std::optional<double> rate, time;
};
template <class Visitor>
void describe(Visitor& visit, Ramp& s) {
  visit("to", s.to, level_info("where the ramp ends", true));
  visit("rate", s.rate, rate_info("how fast; or give time"));
  visit("time", s.time,
        {.unit = "s", .min = 0, .max = 1e7, .exclusive_min = true, .doc = "how long; or give rate"});
}

struct Hold {
  static constexpr std::string_view kind = "hold";
  double time = 0;
};
template <class Visitor>
void describe(Visitor& visit, Hold& s) {
  visit("time", s.time, time_info("how long the level stays", true));
}

// Turning points of minor loops, by a list or evenly from `first` to `last` by `count`. For each point p:
// order 1 (first-order reversal curves, from saturation):  p, hold, back_to, hold_back; without back_to only
// p, hold. order 2 (loops inside a branch): first once to back_to, then as order 1. order 3: p, hold, p +
// rise, through, back_to, hold_back.
struct Reversals {
  static constexpr std::string_view kind = "reversals";
  std::int64_t order = 1;
  std::optional<std::vector<double>> points;
  std::optional<std::int64_t> count;
  std::optional<double> first, last;
  double rate = 0;
  std::optional<double> back_to;
  double hold = 0, hold_back = 0;
  std::optional<double> rise, through;
};
template <class Visitor>
void describe(Visitor& visit, Reversals& s) {
  visit("order", s.order, {.min = 1, .max = 3, .doc = "order of the minor loops"});
  visit("points", s.points, level_info("turning points; or give count, first and last"));
  visit("count", s.count, {.min = 1, .max = 1e5, .doc = "number of evenly spaced turning points"});
  visit("first", s.first, level_info("first of the evenly spaced turning points"));
  visit("last", s.last, level_info("last of the evenly spaced turning points"));
  visit("rate", s.rate, rate_info("of every ramp", true));
  visit("back_to", s.back_to, level_info("level gone back to after each turning point"));
  visit("hold", s.hold, time_info("stay at each turning point"));
  visit("hold_back", s.hold_back, time_info("stay at back_to after each turning point"));
  visit("rise", s.rise, level_info("order 3: how far to go back from the turning point at first"));
  visit("through", s.through, level_info("order 3: level passed on the way back"));
}

enum class Direction { up, down };
inline std::span<const std::pair<Direction, std::string_view>> enum_names(Direction) {
  static constexpr std::pair<Direction, std::string_view> names[] = {{Direction::up, "up"},
                                                                     {Direction::down, "down"}};
  return names;
}

// Cycles between two levels at constant rate. Each cycle leaves the level the segment starts from and comes
// back to it; a level outside [low, high] is first brought to the nearer of the two, at the same rate.
struct Triangle {
  static constexpr std::string_view kind = "triangle";
  double low = 0, high = 0;
  std::optional<double> rate, frequency;
  std::int64_t cycles = 1;
  Direction first = Direction::up;
};
template <class Visitor>
void describe(Visitor& visit, Triangle& s) {
  visit("low", s.low, level_info("lower turning level", true));
  visit("high", s.high, level_info("upper turning level", true));
  visit("rate", s.rate, rate_info("of every ramp; or give frequency"));
  visit("frequency", s.frequency, frequency_info("of the cycles; or give rate"));
  visit("cycles", s.cycles, {.min = 1, .max = 1e6, .doc = "number of cycles"});
  visit("first", s.first, {.doc = "direction in which a cycle sets out"});
}

// center + amplitude sin(2 pi frequency t + phase). Starts with a ramp to its first level, if the program is
// not there, at the sine's own largest slew. One row in the segment table.
struct Sine {
  static constexpr std::string_view kind = "sine";
  double center = 0, amplitude = 0, frequency = 0, cycles = 1, phase = 0;
};
template <class Visitor>
void describe(Visitor& visit, Sine& s) {
  visit("center", s.center, level_info("mean level"));
  visit("amplitude", s.amplitude, amplitude_info("peak minus mean"));
  visit("frequency", s.frequency, frequency_info("cycles per second", true));
  visit("cycles", s.cycles,
        {.min = 0, .max = 1e9, .exclusive_min = true, .doc = "number of cycles, fractions allowed"});
  visit("phase", s.phase,
        {.unit = "degree", .min = -360, .max = 360, .doc = "at the start; 0 rises from the center"});
}

// Positive-up negative-down: a negative preset pulse, then P and U up, N and D down, each from level 0 and
// back to it. Starts with a ramp to 0 at the pulses' slope if the program is not there.
struct Pund {
  static constexpr std::string_view kind = "pund";
  double amplitude = 0, width = 0, delay = 0;
  std::optional<double> rise, rate;
};
template <class Visitor>
void describe(Visitor& visit, Pund& s) {
  visit("amplitude", s.amplitude, level_info("of the up pulses; negative turns all pulses round", true));
  visit("width", s.width, time_info("of a pulse's flat top", true));
  visit("delay", s.delay, time_info("at 0 after each pulse", true));
  visit("rise", s.rise,
        {.unit = "s", .min = 0, .max = 1e7, .exclusive_min = true, .doc = "of each slope; or give rate"});
  visit("rate", s.rate, rate_info("of each slope; or give rise"));
}

// The small-signal response at bias levels: at each of them a ramp there, a stay, then the bias plus
// amplitude sin(2 pi frequency t) for whole cycles, which begins and ends at the bias. The sine must be
// sampled small_signal_samples times a cycle at least: the output goes linearly between samples, by which
// what lags behind the field is off by (pi / samples)^2 / 3 at the most, 0.8 % of itself at that number, and
// the third harmonic is still well below half the sampling rate.
struct SmallSignal {
  static constexpr std::string_view kind = "small_signal";
  std::vector<double> levels;
  double rate = 0, settle = 0, amplitude = 0, frequency = 0;
  std::int64_t cycles = 20;
};
inline constexpr double small_signal_samples = 20;
template <class Visitor>
void describe(Visitor& visit, SmallSignal& s) {
  visit("levels", s.levels, level_info("bias levels, in the order in which they are gone to", true));
  visit("rate", s.rate, rate_info("of the ramps between bias levels", true));
  visit("settle", s.settle, time_info("stay at each bias before its sine", true));
  visit("amplitude", s.amplitude, amplitude_info("peak of the sine minus bias"));
  visit("frequency", s.frequency, frequency_info("of the sine; 20 samples a cycle are the fewest", true));
  visit("cycles", s.cycles,
        {.min = 3, .max = 1e6, .doc = "of the sine at each bias; the first one is not evaluated"});
}

// Straight lines through [time, level] pairs, times from the start of the segment and rising. `csv` gives
// them as text: two columns, time and level, after at most one line of names. If the program is not at the
// first level it ramps there until the first time; where that is 0, ahead of it and as fast as the steepest
// of the lines.
struct Points {
  static constexpr std::string_view kind = "points";
  std::optional<std::vector<std::vector<double>>> points;
  std::optional<std::string> csv;
};
template <class Visitor>
void describe(Visitor& visit, Points& s) {
  visit("points", s.points, {.doc = "pairs [time in s, level]; or give csv"});
  visit("csv", s.csv, {.doc = "a table of time and level, units in its headings; or give points"});
}

struct Node;
// The nested segments, `count` times. The passes of one that is averaged are recorded like any other; their
// mean, without the first one, which brings the specimen into the loop, is made of the recording.
struct Repeat {
  static constexpr std::string_view kind = "repeat";
  std::int64_t count = 1;
  bool average = false;
  nlohmann::json segments;
  std::vector<Node> nodes;  // read from `segments`
};
template <class Visitor>
void describe(Visitor& visit, Repeat& s) {
  visit("count", s.count, {.min = 1, .max = 1e6, .required = true, .doc = "how often"});
  visit("average", s.average,
        {.doc = "reports show the mean over all passes but the first, which a program has of one repeat"});
  visit("segments", s.segments, {.required = true, .doc = "what is repeated"});
}

using Body = std::variant<Ramp, Hold, Repeat, Reversals, Triangle, Sine, Pund, SmallSignal, Points>;

struct Node {
  std::string path;   // JSON pointer into the protocol
  std::string label;  // "" for a made-up one
  Recorded recorded;  // 0: as the repeat around it, or the program
  Body body;
};

// The kinds that only move.
template <class T>
inline constexpr bool has_holds =
    !std::is_same_v<T, Ramp> && !std::is_same_v<T, Triangle> && !std::is_same_v<T, Sine>;

// What stands in one JSON object: kind, label, how it is recorded, and the fields of the kind. The rate and
// the readings of a repeat are for the segments in it that have none themselves.
template <class T>
struct Entry {
  std::string kind{T::kind};
  std::string label;
  std::optional<double> sample_rate, readings_per_decade;
  T body;
};
template <class Visitor, class T>
void describe(Visitor& visit, Entry<T>& entry) {
  visit("kind", entry.kind, {.required = true});
  visit("label", entry.label, {.doc = "name in the segment table"});
  describe(visit, entry.body);
  visit("sample_rate_Hz", entry.sample_rate,
        {.unit = "Hz",
         .min = 0,
         .max = 1e7,
         .exclusive_min = true,
         .doc = "rows recorded a second; else as the program"});
  if constexpr (has_holds<T>)
    visit("readings_per_decade", entry.readings_per_decade,
          {.min = 1,
           .max = 1e4,
           .doc = "in holds, rows recorded in each decade of time; first as the sample rate, at last every "
                  "10 s"});
}

inline constexpr double same_level = 1e-9;  // in the unit of the file: levels closer than this are one
inline constexpr int max_depth = 8;         // of nested repeats
inline constexpr int fewest_averaged = 3;   // passes: one that is left out, and two
inline constexpr std::size_t max_pieces = 1'000'000;
inline constexpr double max_duration = 1e7;  // s

// Reads an array of segments, parameters already replaced; adds every problem. `unit`: of their levels.
std::vector<Node> read_segments(const nlohmann::json& list, const std::string& path, int depth, Unit unit,
                                std::vector<Problem>& problems);

}  // namespace ferrobench::protocols

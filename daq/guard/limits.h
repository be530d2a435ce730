// What a specimen and its bench may be exposed to.
#pragma once

#include <vector>

#include "base/fields.h"

namespace ferrobench::daq {

// Nobody waits longer than this for the output to be at zero, unless the amplifier can do no better.
inline constexpr double usual_stop_time = 10;  // s

// The defaults let every shipped experiment run on every shipped specimen (100 um layers, up to 150 V, 20
// mm), and little more. Zero field is the safe state, so the field range always holds it.
struct Limits {
  double field_min = -1.6e6;  // V/m
  double field_max = 1.6e6;   // V/m
  double slew = 1e8;          // V/m/s; the fastest shipped experiment asks for 5e7
  double stop_slew = 1e6;     // V/m/s of every way back to zero: 1.6 s from full field, no shock to the stack
  double stop_time = usual_stop_time;  // s; the way back may never take longer, whatever is changed
  // Below the threshold the specimen depoles; it may stay there for the time, in one go.
  double reverse_field_threshold = -2e5;  // V/m
  double reverse_field_time = 300;        // s
  double displacement_min = -1e-4;        // m
  double displacement_max = 1e-4;         // m
  double force_min = -500;                // N
  double force_max = 2000;                // N
  // A measured field this share of the range outside field_min..field_max means a broken amplifier.
  double monitor_margin = 0.05;
};

template <class Visitor>
void describe(Visitor& visit, Limits& l) {
  visit("field_min", l.field_min,
        {.unit = "V/m", .min = -1e9, .max = 0, .doc = "lowest field of the output"});
  visit("field_max", l.field_max,
        {.unit = "V/m", .min = 0, .max = 1e9, .doc = "highest field of the output"});
  visit("slew", l.slew,
        {.unit = "V/m/s",
         .min = 0,
         .max = 1e12,
         .exclusive_min = true,
         .doc = "steepest change of the output"});
  visit("stop_slew", l.stop_slew,
        {.unit = "V/m/s",
         .min = 0,
         .max = 1e12,
         .exclusive_min = true,
         .doc = "slew of every way back to zero; a second stop goes at slew"});
  visit("stop_time", l.stop_time,
        {.unit = "s",
         .min = 0,
         .max = 120,
         .exclusive_min = true,
         .doc = "longest way back to zero, from the largest field at stop_slew; more than 10 s is for an "
                "amplifier that is slower, and limits.set then wants the reason"});
  visit("reverse_field_threshold", l.reverse_field_threshold,
        {.unit = "V/m", .min = -1e9, .max = 0, .doc = "a field below this counts as reverse"});
  visit("reverse_field_time", l.reverse_field_time,
        {.unit = "s", .min = 0, .max = 1e9, .doc = "longest time at reverse field in one go"});
  visit("displacement_min", l.displacement_min,
        {.unit = "m", .max = 0, .doc = "measured, below it the run stops"});
  visit("displacement_max", l.displacement_max,
        {.unit = "m", .min = 0, .doc = "measured, above it the run stops"});
  visit("force_min", l.force_min, {.unit = "N", .doc = "measured, below it the run stops"});
  visit("force_max", l.force_max, {.unit = "N", .doc = "measured, above it the run stops"});
  visit("monitor_margin", l.monitor_margin,
        {.min = 0, .max = 1, .doc = "share of the field range by which the measured field may go beyond it"});
}

// Everything wrong with the values themselves, by the ranges above and against each other.
std::vector<Problem> problems(const Limits& limits);
// Throws Error(invalid_params).
Limits limits_from_json(const nlohmann::json& json);

}  // namespace ferrobench::daq

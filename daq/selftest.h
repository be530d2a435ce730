// Whether a device does what it says, measured: a small waveform with the
// output looped back to the field monitor.
#pragma once

#include <functional>

#include "base/fields.h"
#include "daq/device.h"

namespace ferrobench::daq {

struct SelftestRow {
  std::string quantity{};
  double measured = 0;
  double lowest = 0, highest = 0;  // still good
  std::string unit{};
  bool passed = false;
};
template <class Visitor>
void describe(Visitor& visit, SelftestRow& r) {
  visit("quantity", r.quantity, {.required = true});
  visit("measured", r.measured, {.required = true, .doc = "null where the device gave no value"});
  visit("lowest", r.lowest, {.required = true, .doc = "that is still good"});
  visit("highest", r.highest, {.required = true, .doc = "that is still good"});
  visit("unit", r.unit, {.required = true, .doc = "of all three"});
  visit("passed", r.passed, {.required = true});
}

struct SelftestReport {
  bool passed = false;     // every row did
  double sample_rate = 0;  // Hz, what the device made of the one asked for
  std::vector<SelftestRow> rows{};
};
template <class Visitor>
void describe(Visitor& visit, SelftestReport& r) {
  visit("passed", r.passed, {.required = true, .doc = "every row has"});
  visit("sample_rate_Hz", r.sample_rate, {.unit = "Hz", .required = true, .doc = "at which it was tested"});
  visit("rows", r.rows, {.required = true});
}

inline constexpr double selftest_rate = 1000;  // Hz, unless asked for another

// Holds, ramps to 5e4 V/m (5 V on 100 um) and back, two seconds in all, or
// longer where the rate is so low that this would be few rows; needs the field,
// as counts or in SI. Compares the monitor's offset and gain, the noise of each
// channel with what the device states, the number of rows and, where the clock
// is real, the rate. `stop_wanted` is asked with each block: why the test must
// end, or ""; it ends with the output at zero then and throws Error(cancelled).
// Throws Error(bad_state) for a device that measures nothing,
// Error(invalid_params) for a rate that it does not have, Error(device_lost) if
// it does not come to the end. Whatever is thrown says so if the output may not
// be at zero.
SelftestReport selftest(Device& device, double rate = selftest_rate,
                        const std::function<std::string()>& stop_wanted = {});

}  // namespace ferrobench::daq

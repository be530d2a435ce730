// Whether a device does what it says, measured: a small waveform with the output looped back to the field
// monitor.
#pragma once

#include <functional>

#include "daq/device.h"

namespace ferrobench::daq {

struct SelftestRow {
  std::string quantity;
  double measured = 0;
  double lowest = 0, highest = 0;  // still good
  std::string unit;
  bool passed() const { return measured >= lowest && measured <= highest; }
};

struct SelftestReport {
  std::vector<SelftestRow> rows;
  bool passed() const;
};
nlohmann::json to_json(const SelftestReport& report);

// Holds, ramps to 5e4 V/m (5 V on 100 um) and back, two seconds in all; needs a field column. Compares the
// monitor's offset and gain, the noise of each column with what the device states, the number of rows and,
// where the clock is real, the rate. `stop_wanted` is asked with each block: why the test must end, or "";
// it ends with the output at zero then and throws Error(cancelled). Throws Error(device_lost) if the device
// does not come to the end.
SelftestReport selftest(Device& device, const std::function<std::string()>& stop_wanted = {});

}  // namespace ferrobench::daq

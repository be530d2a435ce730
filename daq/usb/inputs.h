// The inputs of a scan: their order in a tick, and what a code of each means.
//
// A count is the converter's code - 32768, with the unit's calibration and the sensor in gain and offset of
// the column. Where a sensor has a table, the count is on an even grid over the table's values instead, so
// that a column stays linear whatever the sensor does; the table is in the device's info.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "daq/usb/calibration.h"
#include "daq/usb/config.h"

namespace ferrobench::daq::usb {

struct InputColumn {
  recordings::RawColumn column;
  QueueElement element;
  std::optional<double> noise;  // SI
  std::optional<double> gain_uncertainty;
  std::vector<std::int16_t> by_code;  // 65,536 counts where there is a table, else empty
  int lowest_code = 1;                // a code below or above has clipped
  int highest_code = 65534;

  std::int16_t count(std::uint16_t code) const {
    return by_code.empty() ? static_cast<std::int16_t>(code - 32768) : by_code[code];
  }
};

// The codes that a marker may show.
struct Marker {
  std::size_t position = 0;  // in a tick
  int lowest_code = 0, highest_code = 65535;
};

class Inputs {
 public:
  Inputs(const UsbConfig& config, const Calibration& calibration);

  // The measured columns; the first is the field monitor. They come first in a tick, the marker is last.
  std::span<const InputColumn> columns() const { return columns_; }
  std::span<const QueueElement> queue() const { return queue_; }
  std::size_t width() const { return queue_.size(); }  // of a tick
  const std::optional<Marker>& marker() const { return marker_; }

 private:
  std::vector<InputColumn> columns_;
  std::vector<QueueElement> queue_;
  std::optional<Marker> marker_;
};

}  // namespace ferrobench::daq::usb

// The amplifier between the unit's output and the specimen, and whether it can do what a program asks.
#pragma once

#include "daq/device.h"
#include "daq/usb/calibration.h"
#include "daq/usb/config.h"
#include "protocols/waveform.h"

namespace ferrobench::daq::usb {

class Amplifier {
 public:
  // `unit`: what the unit's output reaches.
  Amplifier(const AmplifierConfig& amplifier, const SpecimenConfig& specimen,
            VoltRange unit = {-output_full_scale, output_full_scale});

  // Field [V/m] to the voltage that the unit must put out [V], and back.
  double output_volts(double field) const { return field * volts_per_field_; }
  double field(double output_volts) const { return output_volts / volts_per_field_; }
  // What amplifier and unit can reach together, V/m.
  OutputRange range() const { return range_; }

 private:
  double volts_per_field_;
  OutputRange range_;
};

// Every way in which the program, as it will be sampled, does not fit: voltage, slew, and the current
// capacitance dV/dt that it needs. `range` [V/m]: what amplifier and unit reach together. Paths are
// "/segments/N/..." as in the program's segment table.
std::vector<Problem> check_amplifier(const protocols::SampledWaveform& program,
                                     const AmplifierConfig& amplifier, const SpecimenConfig& specimen,
                                     const OutputRange& range);

}  // namespace ferrobench::daq::usb

// What was measured, as a recording: the field of a voltage, the charge of a polarization or of a current,
// the checks, and all that was found as events and in instrument/device.
#pragma once

#include "recordings/exchange/conversion/measured.h"
#include "recordings/exchange/conversion/specimen.h"

namespace ferrobench::recordings {

// What the user says of a recording.
struct Identity {
  std::string title{}, source{};
  LoadCase load{};
  ChargeReference charge_reference = ChargeReference::first_sample;  // of a charge that was measured
  KnownSpecimen specimen{};
};

struct Imported {
  Recording recording{};
  Findings findings{};  // the recording has them, too
};

// `device` is what the source says of itself. A charge that follows from a polarization or a current counts
// from the first sample, as the zero of an integral is nowhere.
Imported recording_of(Measured&& m, Specimen specimen, const Identity& identity, nlohmann::json device);

}  // namespace ferrobench::recordings

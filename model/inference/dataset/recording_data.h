// A recording as a fit sees it: the drive as knots, the rows that take part, and what was measured there.
// Made once, immutable, shared by all simulations.
#pragma once

#include <array>
#include <span>
#include <string>
#include <vector>

#include "recordings/format/recording.h"

namespace ferrobench::model {

// The channels that a model predicts.
inline constexpr std::array<recordings::Channel, 3> predicted_channels{
    recordings::Channel::charge, recordings::Channel::displacement, recordings::Channel::force};

// A field that is linear between its knots; time from the recording's first sample, s, and V/m.
struct Drive {
  std::vector<double> time, field;
};

struct MeasuredColumn {
  recordings::Channel channel = recordings::Channel::displacement;
  std::vector<std::size_t> rows;  // of RecordingData::time where it was measured
  std::vector<double> value;      // SI, at those rows, less its mean
  double range = 0;               // largest less smallest value of the whole recording
  double error = 0;               // what a miss is counted in, SI; 0: a hundredth of the range
};

struct RecordingData {
  recordings::Header header;
  protocols::Past past;      // that is simulated: the header's, or one that was chosen where it has none
  std::vector<double> time;  // s from the first sample, of the rows that take part
  std::vector<MeasuredColumn> columns;
  Drive drive;
  // For coarse simulations: off the drive by 0.2 % of the largest field at most, by 1 % where it is noisy.
  Drive simplified;

  // What was given and says nothing, a sentence each.
  std::vector<std::string> unused;
};

// At most 2000 rows, evenly spread: slow against the noise of a recording, and quick to simulate. Samples
// that are not finite are gaps: no evidence of range or of misfit. The skew of a multiplexer is taken out
// first. Throws Error(bad_recording) without a drive.
RecordingData prepare(recordings::Recording recording);

// How fast a field goes in the mean, V/m/s; 0 where nothing moves.
double mean_pace(std::span<const double> time, std::span<const double> field);
// The largest absolute value, V/m.
double largest_field(std::span<const double> field);

// What recordings can tell of a model's parameters.
struct Evidence {
  double largest_field = 0;         // V/m that the specimen was driven to; 0: not known
  double largest_polarization = 0;  // C/m^2, half of the charge's range over the electrodes' area
  bool shows_elasticity = true;     // strain was measured, or a stress acts on what was
};
Evidence evidence_of(std::span<const RecordingData> recordings);

// The line through fewer knots that is nowhere off by more than `tolerance` [V/m] (Douglas and Peucker 1973).
Drive simplify(const Drive& drive, double tolerance);

}  // namespace ferrobench::model

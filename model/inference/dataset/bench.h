// Recordings made ready to be compared with simulations: checked, thinned to a bounded number of rows, and
// each row put into the class of segment that it lies in. They are made once and not changed afterwards.
#pragma once

#include <Eigen/Dense>
#include <array>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "model/inference/dataset/segment_class.h"
#include "model/model.h"
#include "model/sensitivities.h"
#include "model/simulator.h"
#include "recordings/analysis/noise_colour.h"
#include "recordings/format/recording.h"

namespace ferrobench::model {

struct NamedRecording {
  std::string name;
  recordings::Recording recording;
};

}  // namespace ferrobench::model

namespace ferrobench::model::inference {

// The channels that are compared; the field only where a command says what was asked for.
inline constexpr std::array<recordings::Channel, 4> compared_channels{
    recordings::Channel::field, recordings::Channel::charge, recordings::Channel::displacement,
    recordings::Channel::force};

struct MeasuredChannel {
  recordings::Channel channel = recordings::Channel::displacement;
  std::vector<double> value;         // at the rows; NaN where nothing was measured
  double range = 0;                  // highest less lowest
  double scatter = 0;                // standard deviation of white noise, of all samples (statistics.h)
  recordings::QuietWindows quiet{};  // of all samples: rows may be too far apart to show the noise's colour
  bool zeroed = false;               // at the first sample
};

struct BenchRecording {
  std::string name;
  recordings::Header header;
  bool has_command = false;
  std::vector<double> knot_time, knot_field;  // the drive, linear between its knots
  // Where the drive was read from the measured field, the knots are as good as the field's noise lets them
  // be: errors of (levels, times of the inner knots) = knot_error * (independent unit normals). See drive.h.
  std::vector<std::size_t> level_of;  // of the knots; both ends of a hold share one. Empty: known
  Eigen::MatrixXd knot_error;
  // The past is a visit whose level and time were estimated, and are nuisance parameters.
  bool past_is_free = false;
  // With these errors of (levels, times of the inner knots).
  BenchRecording with_knots_moved(const Eigen::VectorXd& errors) const;
  double sampling_interval = 0;             // s, the mean of all samples
  std::vector<double> time;                 // of the rows, s from the first sample
  std::vector<SegmentClass> segment_class;  // of the rows
  std::vector<MeasuredChannel> channels;

  double duration() const { return knot_time.back(); }
  const MeasuredChannel* find(recordings::Channel channel) const;
};

// Whether any offset of a channel is as good as another: it was zeroed, or the specimen did not start poled,
// and no sensor has a zero then that a model would know.
bool offset_is_free(const BenchRecording& recording, const MeasuredChannel& measured);

// Throws Error(bad_recording) that names the first one that nothing can be done with, Error(invalid_params)
// if there is none or two have one name.
void check_recordings(const std::vector<NamedRecording>& recordings);
// The recordings in the order given, with about `rows` rows together. What was left out, and why, is added
// to `warnings`. Throws Error(bad_recording) that names the recording if one cannot be compared with
// anything. `stop` as in SimulationOptions.
std::vector<BenchRecording> prepare_bench(const Model& model, const std::vector<NamedRecording>& recordings,
                                          std::size_t rows, std::vector<std::string>& warnings,
                                          const std::function<bool()>* stop = nullptr);

// What the model, under the recording's load and drive and after its past, gives at its rows, in the order of
// its channels. Throws Error(numerical) if the model cannot be solved. `statistics`, if not null, says what
// that took.
std::vector<std::vector<double>> simulate_bench(const Model& model, const BenchRecording& recording,
                                                const SimulationOptions& options,
                                                SimulationStatistics* statistics = nullptr);
// The same, of several models that differ in their sensors only.
std::vector<std::vector<std::vector<double>>> simulate_bench(std::span<const Model> models,
                                                             const BenchRecording& recording,
                                                             const SimulationOptions& options,
                                                             SimulationStatistics* statistics = nullptr);
// The same with slopes by numbers of the model and by directions of the drive.
struct BenchSlopes {
  std::vector<std::vector<double>> values;  // by channel, as above
  std::vector<std::vector<double>> slopes;  // by channel: rows x (numbers + directions)
};
BenchSlopes simulate_bench_with_slopes(const Model& model, const BenchRecording& recording,
                                       std::span<const std::string> numbers,
                                       const DriveDirections& directions, const SimulationOptions& options);

}  // namespace ferrobench::model::inference

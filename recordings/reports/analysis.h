// What several tables and pictures of a report need of one recording, found once and only when wanted. Not
// thread-safe.
#pragma once

#include <optional>
#include <vector>

#include "recordings/analysis/clipping.h"
#include "recordings/analysis/cycles.h"
#include "recordings/analysis/loop_measures.h"
#include "recordings/analysis/mean_of_passes.h"
#include "recordings/analysis/pund.h"
#include "recordings/analysis/small_signal.h"

namespace ferrobench::recordings {

class Analysis {
 public:
  // Implicit, so that a table can be made of a recording; which outlives this.
  Analysis(const Recording& r) : recording(r) {}  // NOLINT(google-explicit-constructor)

  const Recording& recording;
  const std::vector<BiasSine>& sines() const {
    if (!sines_) sines_ = bias_sines(recording);
    return *sines_;
  }
  const std::vector<SmallSignalPoint>& small_signal() const {
    if (!small_signal_) small_signal_ = find_small_signal(recording, sines());
    return *small_signal_;
  }
  const Turns& turns() const {
    if (!turns_) turns_ = turning_points(recording, sines());
    return *turns_;
  }
  const std::vector<Cycle>& cycles() const {
    if (!cycles_) cycles_ = find_cycles(recording, turns());
    return *cycles_;
  }
  const LoopMeter& meter() const {
    if (!meter_) meter_.emplace(recording, turns());
    return *meter_;
  }
  const Clipping& clipping() const {
    if (!clipping_) clipping_.emplace(recording);
    return *clipping_;
  }
  // None unless the recording is of a positive-up-negative-down sequence.
  const std::optional<PulseSequence>& pulses() const {
    if (!pulses_) pulses_ = pulse_sequence(recording);
    return *pulses_;
  }
  // None unless the protocol averages a repeat.
  const std::optional<MeanOfPasses>& mean() const {
    if (!mean_) mean_ = mean_of_passes(recording);
    return *mean_;
  }
  // Of cycles(), one by one.
  const std::vector<LoopMeasures>& measures() const {
    if (!measures_) {
      measures_.emplace();
      for (const auto& cycle : cycles()) measures_->push_back(meter().measure(cycle));
    }
    return *measures_;
  }

 private:
  mutable std::optional<std::vector<BiasSine>> sines_;
  mutable std::optional<std::vector<SmallSignalPoint>> small_signal_;
  mutable std::optional<Turns> turns_;
  mutable std::optional<std::vector<Cycle>> cycles_;
  mutable std::optional<LoopMeter> meter_;
  mutable std::optional<Clipping> clipping_;
  mutable std::optional<std::optional<PulseSequence>> pulses_;
  mutable std::optional<std::optional<MeanOfPasses>> mean_;
  mutable std::optional<std::vector<LoopMeasures>> measures_;
};

}  // namespace ferrobench::recordings

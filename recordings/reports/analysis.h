// What several tables of a report need of one recording, found once and only when wanted. Not thread-safe.
#pragma once

#include <optional>
#include <vector>

#include "recordings/reports/cycles.h"
#include "recordings/reports/loop_measures.h"

namespace ferrobench::recordings {

class Analysis {
 public:
  // Implicit, so that a table can be made of a recording; which outlives this.
  Analysis(const Recording& r) : recording(r) {}  // NOLINT(google-explicit-constructor)

  const Recording& recording;
  const std::vector<Cycle>& cycles() const {
    if (!cycles_) cycles_ = find_cycles(recording);
    return *cycles_;
  }
  const LoopMeter& meter() const {
    if (!meter_) meter_.emplace(recording);
    return *meter_;
  }

 private:
  mutable std::optional<std::vector<Cycle>> cycles_;
  mutable std::optional<LoopMeter> meter_;
};

}  // namespace ferrobench::recordings

// What all threads of a fit share: the caller's wishes, asked one at a time, how far it is, and the best so
// far.
#pragma once

#include <algorithm>
#include <limits>
#include <memory>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include "model/inference/study/fit.h"

namespace ferrobench::model {

// A place in the unit cube of the free parameters, with the residuals that it was found in: those of
// recordings have pasts that may be others for each candidate.
struct FitCandidate {
  std::shared_ptr<const ResidualModel> residuals;
  std::vector<double> at{};
  double squares = std::numeric_limits<double>::infinity();  // sum of squared residuals
};

class FitWatch {
 public:
  explicit FitWatch(const FitOptions& options) : options_(options) {
    stop_ = [this] {
      const std::lock_guard lock(mutex_);
      if (!stopped_ && options_.simulation.stop != nullptr) stopped_ = (*options_.simulation.stop)();
      return stopped_;
    };
  }

  const std::function<bool()>* stop() const { return &stop_; }
  // What follows takes the fit from one fraction of its time to another, in about so many simulations.
  void stage(std::string name, double from, double to, int simulations) {
    const std::lock_guard lock(mutex_);
    progress_.stage = std::move(name);
    from_ = from;
    to_ = to;
    expected_ = std::max(1, simulations);
    done_ = 0;
  }
  // Before each simulation. Throws Error(cancelled) once the caller wants no more; the first is always made.
  void count() {
    const std::lock_guard lock(mutex_);
    ++done_;
    progress_.fraction = from_ + (to_ - from_) * std::min(1.0, static_cast<double>(done_) / expected_);
    if (simulations_++ > 0 && !stopped_ && options_.progress) stopped_ = !options_.progress(progress_);
    if (stopped_) throw Error(ErrorCode::cancelled, "the fit was stopped");
  }
  void keep(FitCandidate candidate) {
    const std::lock_guard lock(mutex_);
    if (candidate.squares >= best_.squares) return;
    best_ = std::move(candidate);
    progress_.cost = best_.squares;
  }
  FitCandidate best() {
    const std::lock_guard lock(mutex_);
    return best_;
  }
  int simulations() const { return simulations_; }

 private:
  const FitOptions& options_;
  std::function<bool()> stop_;
  std::mutex mutex_;
  FitProgress progress_;
  double from_ = 0, to_ = 1;
  int expected_ = 1, done_ = 0, simulations_ = 0;
  bool stopped_ = false;
  FitCandidate best_;
};

}  // namespace ferrobench::model

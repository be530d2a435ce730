#include "protocols/recorded_rows.h"

#include <algorithm>
#include <cmath>

namespace ferrobench::protocols {
namespace {

// s from row to row at the most: who watches a long hold sees that it goes on, and a power cut costs no more.
constexpr double longest_wait = 10;
constexpr double most_samples = 9e15;  // of a program, see SampledWaveform

}  // namespace

RecordedRows::RecordedRows(Recorded asked, double rate) {
  // A rate that is a whole share of the device's own but for rounding is that share.
  constexpr double rounding = 1e-9;
  const auto samples = [](double number) {
    return static_cast<std::uint64_t>(std::clamp(std::floor(number), 1.0, most_samples));
  };
  if (asked.rate > 0) stride_ = samples(rate / asked.rate * (1 + rounding));
  if (asked.per_decade > 0) growth_ = std::pow(10, 1 / asked.per_decade) - 1;
  longest_ = std::max(stride_, samples(longest_wait * rate));
  due_ = stride_;
}

std::uint64_t RecordedRows::step(std::uint64_t from) const {
  if (growth_ == 0) return stride_;
  return static_cast<std::uint64_t>(std::clamp(growth_ * static_cast<double>(from),
                                               static_cast<double>(stride_), static_cast<double>(longest_)));
}

std::uint64_t RecordedRows::count(std::uint64_t samples) const {
  if (samples == 0) return 0;
  std::uint64_t rows = 1, at = stride_;  // the corner; the next row
  while (at < samples) {
    const auto by = step(at);
    std::uint64_t until = at + 1;  // the step is the same before it
    if (growth_ == 0 || by == longest_)
      until = samples;
    else if (by == stride_)  // as long as growth * at is less than a sample more
      until = std::max(until, static_cast<std::uint64_t>(std::min(static_cast<double>(stride_ + 1) / growth_,
                                                                  static_cast<double>(samples))));
    const auto steps = (std::min(until, samples) - at + by - 1) / by;
    rows += steps;
    at += steps * by;
  }
  return rows;
}

}  // namespace ferrobench::protocols

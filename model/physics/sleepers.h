// Which domains may fall asleep and which must wake: the searches over all rows that each step of an ensemble
// begins and ends with, by vector code for the processor it runs on.
#pragma once

#include <cstddef>

namespace ferrobench::model {

// A sleeper is woken when the field leaves (low, high) or the stress's path or the time reaches its bound.
// Columns padded as DomainColumns are.
struct SleepBounds {
  const double* low_field = nullptr;    // V/m
  const double* high_field = nullptr;   // V/m
  const double* stress_path = nullptr;  // Pa
  const double* time = nullptr;         // s
};
struct SleepState {
  double field = 0, stress_path = 0, time = 0;
};

// The rows from `first` up to `end`, ascending, whose bounds do not hold; returns how many. A bound that is
// no number does not hold.
std::size_t find_due(const SleepBounds& bounds, std::size_t first, std::size_t end, const SleepState& at,
                     std::size_t* rows);

// Outflows as in StepOutput.
struct QuietLimits {
  double falling = 0, rising = 0, sum = 0;
};

// The rows below `count`, ascending, whose outflows are below all limits; returns how many.
std::size_t find_quiet(const double* falling, const double* rising, std::size_t count,
                       const QuietLimits& limits, std::size_t* rows);

}  // namespace ferrobench::model

// The standard uncertainty of a figure that is read from samples, after the Guide to the Expression of
// Uncertainty in Measurement (JCGM 100:2008, GUM).
//
// A figure f is read from samples y_i of a channel by a local fit, f = sum over i of w_i y_i near the samples
// at hand, w_i = df/dy_i. Law of propagation with correlated inputs (GUM 5.2.2):
//
//   u^2(f) = sum over i, j of w_i w_j c(|i - j|) + (g f)^2,    c(k) = white^2 [k = 0] + slow^2 exp(-k / rows)
//
// - c is the autocovariance of the channel's noise, estimated from the recording itself (noise_colour.h).
// - g is the relative standard uncertainty of the channel's gain, where the file has it; it is the same for
//   all figures of a channel, so that the ratio of two of them does not have it.
// - The local fit: its window is as wide as noise needs and as narrow as the curve asks for (local_fit.h), so
//   that what the fit cannot follow stays well below the noise; it has no term of its own.
// - Rounding: noise of half a count or more makes the error of rounding part of the noise; with less, the
//   same error stands in all samples of a window: lsb / sqrt(12) (GUM F.2.2.1), correlated over 50 rows.
//
// A figure of two channels adds the squares of both. Figures are close to normal, as many samples are behind
// each, so that f +- 2 u covers the true value in 95 % (k = 2). That holds where a figure depends on the
// samples linearly within their noise (JCGM 101:2008, 5.7). Where it does not, because noise has a part in
// which of several places it is read from, none is stated: the largest of many cycles, a level that noise
// passes again and again, time to half. What is not in u: drift of a zero between two readings, hum, and what
// is wrong with the specimen's size.
#pragma once

#include <cmath>
#include <cstddef>
#include <span>
#include <vector>

#include "recordings/analysis/noise_colour.h"

namespace ferrobench::recordings {

// A figure with the two parts of its standard uncertainty, in its unit. Both 0: nothing is known (a
// simulation without noise).
struct Estimate {
  double value = 0;
  double noise = 0;        // of one figure alone
  double calibration = 0;  // from the gain: all figures of a channel have it together
  double uncertainty() const { return std::hypot(noise, calibration); }
};

// How a figure changes with one sample of a channel.
struct Weight {
  std::size_t sample = 0;
  double weight = 0;
};

// A figure as the samples of one channel make it.
struct Reading {
  double value = 0;
  std::vector<Weight> weights;  // in any order; a sample may come more than once

  Reading& operator+=(const Reading& other);
  Reading& operator*=(double factor);
};
Reading operator+(Reading a, const Reading& b);
Reading operator-(Reading a, Reading b);
Reading operator*(double factor, Reading a);
Reading abs(Reading a);

// The noise of a channel: c(k) above.
class Noise {
 public:
  Noise() = default;  // none
  // Of this standard deviation in all; `lsb`: of the converter, 0 if not known. All in the channel's unit.
  Noise(double deviation, const NoiseColour& colour, double lsb);

  // Of a figure with these weights.
  double variance(std::vector<Weight> weights) const;
  // Of the mean of so many samples in a row.
  double variance_of_mean(std::size_t samples) const;
  // Of a figure with weights that change little from one sample to the next, from the sum of their squares.
  double variance_of_sum(double squares) const;

 private:
  struct Slow {
    double variance = 0, rows = 1;
  };
  double white_ = 0;        // variance
  std::vector<Slow> slow_;  // correlated noise, rounding
};

}  // namespace ferrobench::recordings

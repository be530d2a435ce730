// The few estimates that segments, reports and tables share. Samples that are NaN belong to gaps.
#pragma once

#include <span>
#include <vector>

namespace ferrobench::recordings {

struct Line {
  double x0 = 0, y0 = 0;  // a point on it (the mean of the samples)
  double slope = 0;
  double at(double x) const { return y0 + slope * (x - x0); }
};

// Least squares; samples with NaN are left out. Fewer than two distinct x: slope 0.
Line fit_line(std::span<const double> x, std::span<const double> y);

// Standard deviation of white noise on a smooth signal: the median of |y[i-1] - 2 y[i] + y[i+1]| over 0.6745
// sqrt(6). Zero for a noise-free line. Curvature counts as noise where it passes the noise from sample to
// sample.
double estimate_noise(std::span<const double> y);

double median(std::vector<double> values);  // NaN if empty
double mean(std::span<const double> y);     // of what is not NaN; NaN if nothing is

}  // namespace ferrobench::recordings

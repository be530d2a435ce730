// A line through many points with as few of them as a picture needs.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

namespace ferrobench::recordings {

// Indices of the points to keep, in order. Every point left out lies within `error` of the piece of the new
// line that stands for it, where x counts in `x_unit` and y in `y_unit`. Points with NaN break the line; of
// several in a row one is kept.
//
// One pass: from a point that is kept, the directions are narrowed to those that pass every later point
// within error / 2; the line ends before it leaves them or turns back by error / 2 (Sklansky and Gonzalez,
// Pattern Recognition 12, 1980).
std::vector<std::size_t> thin(std::span<const double> x, std::span<const double> y, double x_unit,
                              double y_unit, double error);

struct Thinned {
  std::vector<std::size_t> kept;
  double error = 0;  // as asked for, or the smallest power of two times that with which `most` points do
};
Thinned thin_to(std::span<const double> x, std::span<const double> y, double x_unit, double y_unit,
                double error, std::size_t most);

// The first rows of at most `most` stretches of rows, for a picture against time. No stretch is longer than a
// share of the rows or a share of the duration, and a row beside a longer pause stands alone: so a hold with
// few rows and a ramp with many are each drawn where they were. The shares are the smallest that do.
std::vector<std::size_t> stretches(std::span<const double> time, std::size_t most);

}  // namespace ferrobench::recordings

// Numbers of one loop: lists of points that follow each other, NaN left out, closed by a straight line.
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

namespace ferrobench::recordings {

// The integral of x dy around the closed loop (Green): positive if the loop runs anticlockwise in the x-y
// plane.
double loop_integral(std::span<const double> x, std::span<const double> y);

// The area between the way out and the way back, if x goes from one end to the other and back once, wherever
// it begins (the parts of a figure eight add up); else the integral above without its sign.
double enclosed_area(std::span<const double> x, std::span<const double> y);
// The part of it from where both ways have values of y that differ by less than `limit`.
double thin_area(std::span<const double> x, std::span<const double> y, double limit);

struct Extremes {
  double low, high;
  std::size_t low_at, high_at;  // the first sample that has it
  double span() const { return high - low; }
};
std::optional<Extremes> extremes(std::span<const double> values);  // none if there is no value

// Where y passes `level`, linear between the samples `before` and `after`; each passing once, in order.
struct Crossing {
  std::size_t before, after;
  double share;  // of the way from one to the other
  double of(std::span<const double> x) const { return x[before] + (x[after] - x[before]) * share; }
};
std::vector<Crossing> crossings(std::span<const double> y, double level);

}  // namespace ferrobench::recordings

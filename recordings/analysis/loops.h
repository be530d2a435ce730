// Numbers of one loop: lists of points that follow each other, NaN left out, closed by a straight line.
#pragma once

#include <optional>
#include <span>
#include <vector>

namespace ferrobench::recordings {

// The integral of x dy around the closed loop (Green): positive if the loop runs anticlockwise in the x-y
// plane.
double loop_integral(std::span<const double> x, std::span<const double> y);

// The area between the way out and the way back, if x goes to its far end and back once (the parts of a
// figure eight add up); else the integral above without its sign.
double enclosed_area(std::span<const double> x, std::span<const double> y);

struct Extremes {
  double low, high;
  double span() const { return high - low; }
};
std::optional<Extremes> extremes(std::span<const double> values);  // none if there is no value

// x where y passes `level`, linear between samples; each passing once, in order.
std::vector<double> crossings(std::span<const double> x, std::span<const double> y, double level);

}  // namespace ferrobench::recordings

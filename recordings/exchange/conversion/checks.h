// Columns of one table that say the same twice, or that cannot be as they are. Each check adds what it found;
// none changes a sample.
#pragma once

#include <cmath>
#include <span>

#include "recordings/exchange/conversion/measured.h"

namespace ferrobench::recordings {

// Of the values that are there; without any, the span is no number above zero.
struct Range {
  double low = INFINITY, high = -INFINITY;
  double span() const { return high - low; }
  double middle() const { return 0.5 * (high + low); }
};
Range range_of(std::span<const double> values);

// The integral of i over t by trapezoids, from zero at the first sample; over a gap nothing is added.
Values integral(std::span<const double> time, std::span<const double> current);

// How closely a polarization times the area follows the integral of a current: within each block
// A (P - P0) = slope * integral, and the rms of what is left over the range.
struct Agreement {
  double slope = 0, rms = 0, range = 0;  // range: of A P, in C
};
std::optional<Agreement> agreement(std::span<const double> time, std::span<const double> current,
                                   std::span<const double> polarization, double area,
                                   std::span<const std::size_t> blocks);

// A dP against the integral of I dt: says by how much they differ, and with that whether the header's area
// holds. The number of layers over whose area P is the charge: one, or the specimen's, unless one fits
// better.
std::int64_t check_polarization(Measured& m, const Specimen& specimen, bool layers_given);
// The charge against the integral of the current, where both were measured.
void check_charge(Measured& m);
// The middle and the half of the voltage's range against the amplitude asked for.
void check_voltage(Measured& m);
// The integral of E dQ: a specimen takes energy.
void check_energy(Measured& m);

}  // namespace ferrobench::recordings

// Local parabolas where all samples around count.
#pragma once

#include <cstddef>
#include <span>

namespace ferrobench::recordings {

// out[i]: the parabola of least squares through the 2 half + 1 samples around y[i], at y[i]. `y` has `half`
// (2 or more) samples more at either side than `out`. The same on every processor, to the bit.
void parabolas(const double* y, std::size_t half, std::span<double> out);

}  // namespace ferrobench::recordings

// Values at samples, freed of noise by local fits whose windows suit the curve.
//
// A wide window leaves less noise, and cuts corners. So at each sample the window grows from step to step,
// twice as wide each time, as long as its value differs from the one before by no more than sqrt(2 ln n)
// standard deviations of that difference (three at least), which noise alone hardly does in n samples (A.
// Goldenshluger and A. Nemirovski, Math. Methods Stat. 6 (1997) 135; V. Katkovnik, IEEE Trans. Signal
// Process. 47 (1999) 2567). The value is that of the last but one window that agrees: a parabola's error goes
// with the third power of the width or more, so that what the curve does stays well below the noise.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "recordings/analysis/cycles.h"
#include "recordings/analysis/uncertainty.h"

namespace ferrobench::recordings {

// A window around a sample: so many samples before and after it.
struct Reach {
  std::uint8_t before = 0, after = 0;
};

struct Smoothed {
  std::vector<double> values;
  std::vector<Reach> reach;          // 0 and 0: the sample itself
  std::vector<std::size_t> corners;  // ends of legs, rising
};
// Parabolas of least squares over a twentieth of a leg (at most 101 samples) at the widest, and never across
// a turning point, so that a cusp stays one; a leg shorter than 80 samples comes back as it is. NaN stays,
// and windows leave it out.
Smoothed smooth(std::span<const double> y, const Noise& noise, const std::vector<Turn>& turns);
// The value that the parabola over so many samples before and after it has at a sample, with the weights that
// make it.
Reading parabola_reading(std::span<const double> y, std::size_t at, std::size_t before, std::size_t after);
// The value at an extreme of smoothed samples. Noise has a part in where that is, and the largest of many
// values is too large. So the end of a leg counts in place of a sample beside it that is larger by no more
// than two standard deviations of the difference; and the window grows as above over all samples of the leg
// around that noise cannot tell from the extreme (2,000 at either side at the most).
Reading extreme_reading(std::span<const double> y, const Smoothed& smoothed, const Noise& noise,
                        std::size_t at);

// The value at sample `at`, first or last of y[first .. first + count): of lines through 5, 10, 20, ...
// samples next to it, `most` at the most; these count where they agree within one standard deviation.
Reading line_reading(std::span<const double> time, std::span<const double> y, const Noise& noise,
                     std::size_t first, std::size_t count, bool at_end, std::size_t most);

}  // namespace ferrobench::recordings

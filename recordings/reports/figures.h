// The pictures of a recording: channels against time, loops, creep against log time.
#pragma once

#include <vector>

#include "recordings/format/recording.h"
#include "recordings/reports/plot.h"

namespace ferrobench::recordings {

std::vector<Figure> make_figures(const Recording& recording);

// The points of y against x, thinned to the extremes of each of `pieces` stretches of equally many samples:
// what a picture that many pixels wide can show.
std::vector<std::array<double, 2>> thinned(const std::vector<double>& x, const std::vector<double>& y,
                                           std::size_t pieces);

}  // namespace ferrobench::recordings

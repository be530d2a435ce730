// The pictures of a recording: channels against time, loops, creep against log time.
//
// A loop is drawn cycle by cycle, at most 12 of them, in the colour of what tells them apart (parts.h). Its
// line is at most half a thousandth of the axes beside the samples, unless the noise is so large that the
// figure's note says otherwise.
#pragma once

#include <vector>

#include "recordings/reports/analysis.h"
#include "recordings/reports/plot.h"

namespace ferrobench::recordings {

std::vector<Figure> make_figures(const Analysis& analysis);

// The points of y against x, which rises, thinned to the ends and extremes of at most `pieces` stretches
// (thinning.h): what a picture that many pixels wide can show.
std::vector<std::array<double, 2>> band(const std::vector<double>& x, const std::vector<double>& y,
                                        std::size_t pieces);

}  // namespace ferrobench::recordings

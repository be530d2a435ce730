#include "recordings/analysis/bias_sines.h"

#include <algorithm>
#include <cmath>

#include "recordings/analysis/program.h"

namespace ferrobench::recordings {
std::vector<BiasSine> bias_sines(const Recording& r) {
  std::vector<BiasSine> out;
  if (r.size() < fewest_in_sine) return out;
  const auto program = program_of(r.header.protocol);
  if (!program || program->sampling() == 0) return out;  // sines on a bias alone ask for a sampling rate
  auto approach = Approach::none;
  const auto pieces = program->pieces();
  for (std::size_t k = 0; k < std::min(pieces.size(), r.segments.size()); ++k) {
    const auto& piece = pieces[k];
    const auto& row = r.segments[k];
    if (piece.kind == protocols::PieceKind::ramp)
      approach = piece.to > piece.from ? Approach::up : Approach::down;
    // Rows that are not the program's own, of a part of a recording, have other names.
    if (!(piece.sampling > 0) || row.label != program->segments()[k].label || row.start_sample < 0) continue;
    const auto first = static_cast<std::size_t>(row.start_sample);
    const auto last = std::min(static_cast<std::size_t>(row.end_sample), r.size() - 1);
    if (last < first + fewest_in_sine) continue;
    const double step = (r.time[last] - r.time[first]) / static_cast<double>(last - first);
    if (!(r.time[last] - r.time[first] > piece.duration - 1.5 * step)) continue;  // broken off
    out.push_back({.first = first,
                   .last = last,
                   .bias = piece.center,
                   .amplitude = piece.amplitude,
                   .cycles = std::round(piece.duration * piece.frequency),
                   .approach = approach});
  }
  return out;
}

}  // namespace ferrobench::recordings

#include "tests/bench/ours.h"

#include <array>

namespace ferrobench::bench {

OurRun run_ours(const Creep& creep, const model::SimulationOptions& options) {
  OurRun out;
  out.outputs.polarization.resize(creep.outputs);
  out.outputs.stress.resize(creep.outputs);
  out.displacement.resize(creep.outputs);
  model::Simulator simulator(creep.model, options);
  simulator.start(creep.pieces.front().from);
  constexpr std::array<double, 1> zero{0};
  model::ChannelSpans at_start;
  at_start.stress = std::span(&out.first_stress, 1);
  simulator.play(0, creep.pieces.front().from, zero, at_start);
  std::size_t done = 0;
  for (const auto& piece : creep.pieces) {
    const std::size_t count = piece.times.size();
    const auto part = [&](std::vector<double>& column) { return std::span(column).subspan(done, count); };
    model::ChannelSpans spans;
    spans.polarization = part(out.outputs.polarization);
    spans.stress = part(out.outputs.stress);
    spans.displacement = part(out.displacement);
    simulator.play(piece.duration, piece.to, piece.times, spans);
    done += count;
  }
  out.statistics = simulator.statistics();
  return out;
}

}  // namespace ferrobench::bench

// Programs for tests.
#pragma once

#include <cmath>
#include <string>
#include <vector>

#include "protocols/waveform.h"

namespace ferrobench::daq {

inline protocols::Piece line(double from, double to, double duration) {
  return {.kind = from == to ? protocols::PieceKind::hold : protocols::PieceKind::ramp,
          .duration = duration,
          .from = from,
          .to = to};
}

inline protocols::Piece sine(double center, double amplitude, double frequency, double duration,
                             double phase = 0) {
  protocols::Piece piece{.kind = protocols::PieceKind::sine, .duration = duration};
  piece.center = center;
  piece.amplitude = amplitude;
  piece.frequency = frequency;
  piece.phase = phase;
  piece.from = center + amplitude * std::sin(phase);
  piece.to = center + amplitude * std::sin(2 * M_PI * frequency * duration + phase);
  return piece;
}

// The pieces one after the other.
inline protocols::SampledWaveform program(std::vector<protocols::Piece> pieces, double rate) {
  std::vector<protocols::Segment> segments;
  double time = 0;
  for (auto& piece : pieces) {
    piece.start = time;
    time += piece.duration;
    segments.push_back({.kind = piece.kind == protocols::PieceKind::hold ? "hold" : "ramp",
                        .label = "segment " + std::to_string(segments.size()),
                        .start = piece.start,
                        .end = time,
                        .level = piece.to,
                        .rate = std::abs(piece.to - piece.from) / piece.duration});
  }
  return {protocols::Waveform(std::move(pieces), std::move(segments)), rate};
}

}  // namespace ferrobench::daq

// Small protocols for the tests.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "protocols/protocol.h"

namespace ferrobench::protocols {

inline nlohmann::json program(nlohmann::json segments, double start = 0) {
  return {{"format", "ferrobench-protocol"},
          {"version", 1},
          {"name", "test"},
          {"unit", "kV/mm"},
          {"start", start},
          {"segments", std::move(segments)}};
}

inline Waveform expanded(nlohmann::json segments, double start = 0) {
  return Protocol::from_json(program(std::move(segments), start)).expand();
}

// The levels at the corners in kV/mm, the start first.
inline std::vector<double> corner_levels(const Waveform& waveform, double unit = 1e6) {
  std::vector<double> levels{waveform.pieces().front().from / unit};
  for (const auto& piece : waveform.pieces()) levels.push_back(piece.to / unit);
  return levels;
}

inline std::vector<double> durations(const Waveform& waveform) {
  std::vector<double> times;
  for (const auto& piece : waveform.pieces()) times.push_back(piece.duration);
  return times;
}

inline std::vector<std::string> labels(const Waveform& waveform) {
  std::vector<std::string> names;
  for (const auto& segment : waveform.segments()) names.push_back(segment.label);
  return names;
}

}  // namespace ferrobench::protocols

// What holds for every program, tried on random ones.
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <cmath>

#include "tests/protocols/programs.h"

namespace ferrobench::protocols {
namespace {

using nlohmann::json;

double number(int low, int high, double step) {
  return *rc::gen::inRange(low, high + 1) * step;
}
double level() {
  return number(-30, 30, 0.1);
}
double rate() {
  return number(1, 100, 0.1);
}
double time() {
  return number(1, 50, 0.037);
}

json random_segments(int depth);

json random_segment(int depth) {
  switch (*rc::gen::inRange(0, depth < 2 ? 9 : 8)) {
    case 0:
      return {{"kind", "ramp"}, {"to", level()}, {"rate", rate()}};
    case 1:
      return {{"kind", "ramp"}, {"to", level()}, {"time", time()}};
    case 2:
      return {{"kind", "hold"}, {"time", time()}};
    case 3:
      return {{"kind", "reversals"}, {"count", *rc::gen::inRange(1, 5)},
              {"first", level()},    {"last", level()},
              {"rate", rate()},      {"hold", time()},
              {"back_to", level()}};
    case 4: {
      const double low = level();
      return {{"kind", "triangle"}, {"low", low}, {"high", low + time()}, {"rate", rate()}, {"cycles", 2}};
    }
    case 5:
      return {{"kind", "sine"},      {"center", level()}, {"amplitude", time()},
              {"frequency", rate()}, {"cycles", time()},  {"phase", number(-36, 36, 10)}};
    case 6:
      return {
          {"kind", "pund"}, {"amplitude", time()}, {"width", time()}, {"delay", time()}, {"rate", rate()}};
    case 7:
      return {{"kind", "small_signal"},
              {"levels", {level(), level()}},
              {"rate", rate()},
              {"settle", time()},
              {"amplitude", time()},
              {"frequency", rate()},
              {"cycles", *rc::gen::inRange(3, 6)}};
    default:
      return {
          {"kind", "repeat"}, {"count", *rc::gen::inRange(1, 4)}, {"segments", random_segments(depth + 1)}};
  }
}

json random_segments(int depth) {
  auto segments = json::array({{{"kind", "hold"}, {"time", time()}}});
  for (int left = *rc::gen::inRange(0, 5); left > 0; --left) segments.push_back(random_segment(depth));
  return segments;
}

Waveform random_waveform() {
  return expanded(random_segments(0), level());
}

RC_GTEST_PROP(EveryProgram, IsContinuousAndItsTableContiguous, ()) {
  const auto w = random_waveform();
  RC_ASSERT(w.pieces().size() == w.segments().size());
  double end = 0;
  for (std::size_t i = 0; i < w.pieces().size(); ++i) {
    const auto& piece = w.pieces()[i];
    const auto& segment = w.segments()[i];
    RC_ASSERT(segment.start == end);
    RC_ASSERT(segment.start == piece.start);
    RC_ASSERT(segment.end > segment.start);
    RC_ASSERT(segment.level == piece.to);
    RC_ASSERT((segment.kind == "hold") == (segment.rate == 0));
    RC_ASSERT(!segment.label.empty());
    if (i > 0) RC_ASSERT(piece.from == w.pieces()[i - 1].to);
    end = segment.end;
    const double step = 1e-9 * piece.duration;
    RC_ASSERT(std::abs(w.value(piece.start + step) - piece.from) <= w.max_slew() * step * 1.001 + 1e-2);
    RC_ASSERT(std::abs(w.value(end - step) - piece.to) <= w.max_slew() * step * 1.001 + 1e-2);
  }
  RC_ASSERT(end == w.duration());
}

RC_GTEST_PROP(EveryProgram, KeepsItsCornersAndBoundsAtAnyRate, ()) {
  const SampledWaveform s(random_waveform(), std::pow(10, number(-10, 30, 0.1)));
  const auto& w = s.waveform();
  const auto corners = s.corners();
  RC_ASSERT(corners.size() == w.pieces().size() + 1);
  RC_ASSERT(corners.front() == 0U);
  RC_ASSERT(corners.back() + 1 == s.size());
  RC_ASSERT(s.value(0) == w.pieces().front().from);
  for (std::size_t i = 0; i < w.pieces().size(); ++i) {
    RC_ASSERT(corners[i] < corners[i + 1]);
    RC_ASSERT(s.value(corners[i + 1]) == w.pieces()[i].to);
    const double shift = static_cast<double>(corners[i + 1]) / s.rate() - w.segments()[i].end;
    RC_ASSERT(std::abs(shift) <= s.distortion());
  }
  std::vector<double> values(std::min<std::uint64_t>(s.size(), 200000));
  s.fill(0, values);
  const double rounding = 1e-9 * std::max(std::abs(w.minimum()), std::abs(w.maximum()));
  for (std::size_t i = 0; i < values.size(); ++i) {
    RC_ASSERT(values[i] >= w.minimum() - rounding);
    RC_ASSERT(values[i] <= w.maximum() + rounding);
    if (i > 0)
      RC_ASSERT(std::abs(values[i] - values[i - 1]) * s.rate() <=
                s.max_slew() * (1 + 1e-9) + rounding * s.rate());
  }
}

RC_GTEST_PROP(EveryProgram, IsWithinItsBoundsAndReachesThem, ()) {
  const auto w = random_waveform();
  double low = w.value(0), high = low;
  for (const auto& piece : w.pieces()) {
    for (int i = 0; i <= 200; ++i) {
      const double value = piece.value(piece.start + piece.duration * i / 200);
      low = std::min(low, value);
      high = std::max(high, value);
    }
    RC_ASSERT(piece.max_slew() <= w.max_slew());
  }
  RC_ASSERT(low >= w.minimum() - 1e-3);
  RC_ASSERT(high <= w.maximum() + 1e-3);
  const bool bends = std::any_of(w.pieces().begin(), w.pieces().end(),
                                 [](const Piece& piece) { return piece.kind == PieceKind::sine; });
  if (!bends) {
    RC_ASSERT(std::abs(low - w.minimum()) < 1e-3);
    RC_ASSERT(std::abs(high - w.maximum()) < 1e-3);
  }
}

RC_GTEST_PROP(EveryProgram, SurvivesItsOwnJson, ()) {
  const auto given = program(random_segments(0), level());
  const auto first = Protocol::from_json(given);
  const auto second = Protocol::from_text(first.json().dump());
  RC_ASSERT(second.json() == given);
  const auto a = first.expand(), b = second.expand();
  RC_ASSERT(corner_levels(a) == corner_levels(b));
  RC_ASSERT(durations(a) == durations(b));
}

}  // namespace
}  // namespace ferrobench::protocols

#include "protocols/waveform.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <stdexcept>

namespace ferrobench::protocols {
namespace {

using std::numbers::pi;
using testing::DoubleNear;
using testing::ElementsAre;

Waveform of(std::vector<Piece> pieces) {
  double time = 0;
  std::vector<Segment> segments;
  for (auto& piece : pieces) {
    piece.start = time;
    time += piece.duration;
    segments.push_back(
        {.kind = piece.kind == PieceKind::hold ? "hold" : "ramp", .start = piece.start, .end = time});
  }
  return {std::move(pieces), std::move(segments)};
}

Piece ramp(double time, double from, double to) {
  return {.kind = PieceKind::ramp, .duration = time, .from = from, .to = to};
}
Piece hold(double time, double level) {
  return {.duration = time, .from = level, .to = level};
}
Piece sine(double cycles, double phase) {
  return {.kind = PieceKind::sine,
          .duration = cycles / 2.0,
          .from = 1 + 3 * std::sin(phase),
          .to = 1 + 3 * std::sin(phase + 2 * pi * cycles),
          .center = 1,
          .amplitude = 3,
          .frequency = 2,
          .phase = phase};
}

TEST(Waveform, IsLinearOnRampsAndConstantOnHoldsAndOutside) {
  const auto w = of({ramp(2, 1, 5), hold(3, 5), ramp(4, 5, -3)});
  EXPECT_EQ(w.duration(), 9);
  EXPECT_EQ(w.value(-1), 1);
  EXPECT_EQ(w.value(0.5), 2);
  EXPECT_EQ(w.value(2), 5);
  EXPECT_EQ(w.value(4), 5);
  EXPECT_EQ(w.value(6), 3);
  EXPECT_EQ(w.value(100), -3);
  EXPECT_EQ(w.minimum(), -3);
  EXPECT_EQ(w.maximum(), 5);
  EXPECT_EQ(w.max_slew(), 2);
}

TEST(Waveform, OfASineHasItsExactExtremesAndSlew) {
  const auto full = of({sine(1, 0)});
  EXPECT_EQ(full.maximum(), 4);
  EXPECT_EQ(full.minimum(), -2);
  EXPECT_DOUBLE_EQ(full.max_slew(), 12 * pi);
  EXPECT_NEAR(full.value(0.125), 4, 1e-12);

  // From 30 to 60 degrees: neither a crest nor a crossing of the center.
  const auto part = of({sine(1.0 / 12, pi / 6)});
  EXPECT_NEAR(part.minimum(), 2.5, 1e-12);
  EXPECT_NEAR(part.maximum(), 1 + 3 * std::sqrt(0.75), 1e-12);
  EXPECT_NEAR(part.max_slew(), 12 * pi * std::sqrt(0.75), 1e-9);
}

TEST(Waveform, WithAJumpHasInfiniteSlew) {
  EXPECT_EQ(of({hold(1, 0), hold(1, 1)}).max_slew(), std::numeric_limits<double>::infinity());
}

TEST(Waveform, RefusesGapsAndEmptyPieces) {
  const std::vector<Segment> two(2);
  const Piece first = hold(1, 0);
  Piece late = hold(1, 0);
  late.start = 1.5;
  EXPECT_THROW(Waveform({first, late}, two), std::invalid_argument);
  EXPECT_THROW(Waveform({first}, two), std::invalid_argument);
  EXPECT_THROW(of({hold(0, 1)}), std::invalid_argument);
  EXPECT_THROW(of({ramp(1, 0, std::nan(""))}), std::invalid_argument);
  EXPECT_THROW(of({ramp(std::numeric_limits<double>::infinity(), 0, 1)}), std::invalid_argument);
}

TEST(Waveform, OfNothingIsZero) {
  const Waveform w;
  EXPECT_EQ(w.duration(), 0);
  EXPECT_EQ(w.value(1), 0);
  EXPECT_EQ(SampledWaveform(w, 10).size(), 1U);
  EXPECT_EQ(SampledWaveform(w, 10).value(0), 0);
}

TEST(SampledWaveform, HitsCornersThatLieOnTheGrid) {
  const SampledWaveform s(of({ramp(2, 1, 5), hold(3, 5), ramp(4, 5, -3)}), 10);
  EXPECT_THAT(s.corners(), ElementsAre(0, 20, 50, 90));
  EXPECT_EQ(s.size(), 91U);
  EXPECT_EQ(s.distortion(), 0);
  EXPECT_EQ(s.max_slew(), 2);
  EXPECT_EQ(s.value(5), 2);
  EXPECT_EQ(s.value(20), 5);
  EXPECT_EQ(s.value(90), -3);
  EXPECT_EQ(s.value(1000), -3);
}

TEST(SampledWaveform, MovesCornersToTheGridAndSaysHowFar) {
  const SampledWaveform s(of({ramp(0.26, 0, 1), hold(0.3, 1), ramp(0.3, 1, 0)}), 10);
  EXPECT_THAT(s.corners(), ElementsAre(0, 3, 6, 9));
  EXPECT_EQ(s.value(3), 1);
  EXPECT_EQ(s.value(6), 1);
  EXPECT_EQ(s.value(9), 0);
  EXPECT_THAT(s.distortion(), DoubleNear(0.04, 1e-12));
  EXPECT_THAT(s.max_slew(), DoubleNear(1 / 0.3, 1e-9));
}

TEST(SampledWaveform, KeepsEveryCornerWhenThereAreTooFewSamples) {
  const SampledWaveform s(of({ramp(1e-3, 0, 1), ramp(1e-3, 1, 0), ramp(1e-3, 0, 2)}), 10);
  EXPECT_THAT(s.corners(), ElementsAre(0, 1, 2, 3));
  std::vector<double> values(4);
  s.fill(0, values);
  EXPECT_THAT(values, ElementsAre(0, 1, 0, 2));
  EXPECT_THAT(s.distortion(), DoubleNear(0.297, 1e-12));
  EXPECT_THAT(s.max_slew(), DoubleNear(20, 1e-9));
}

TEST(SampledWaveform, FillsInBlocksAsItDoesAtOnce) {
  const SampledWaveform s(of({ramp(0.7, 0, 1), sine(2.5, 0), ramp(0.3, 1, -1), hold(0.2, -1)}), 97);
  std::vector<double> whole(s.size() + 10);
  s.fill(0, whole);
  for (std::uint64_t first = 0; first < s.size(); first += 7) {
    std::vector<double> block(7);
    s.fill(first, block);
    for (std::size_t i = 0; i < block.size(); ++i) EXPECT_EQ(block[i], whole[first + i]);
  }
}

TEST(SampledWaveform, RefusesRatesThatMeanNothing) {
  const auto w = of({ramp(1e6, 0, 1)});
  EXPECT_THROW(SampledWaveform(w, 0), std::invalid_argument);
  EXPECT_THROW(SampledWaveform(w, -1), std::invalid_argument);
  EXPECT_THROW(SampledWaveform(w, std::nan("")), std::invalid_argument);
  EXPECT_THROW(SampledWaveform(w, 1e12), std::invalid_argument);
}

}  // namespace
}  // namespace ferrobench::protocols

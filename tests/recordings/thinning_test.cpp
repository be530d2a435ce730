// Lines thinned by their length, cycles apart, and the figures made of them.
#include "recordings/analysis/thinning.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

#include "recordings/analysis/parts.h"
#include "recordings/reports/figures.h"
#include "tests/recordings/sample.h"
#include "tests/recordings/uneven_rows.h"

namespace ferrobench::recordings {
namespace {

using std::numbers::pi;

double apart(double px, double py, double ax, double ay, double bx, double by) {
  const double length2 = (bx - ax) * (bx - ax) + (by - ay) * (by - ay);
  const double t =
      length2 > 0 ? std::clamp(((px - ax) * (bx - ax) + (py - ay) * (by - ay)) / length2, 0., 1.) : 0;
  return std::hypot(px - ax - t * (bx - ax), py - ay - t * (by - ay));
}

// The largest distance of a point to the piece of the line that stands for it, in the units given.
double worst(const std::vector<double>& x, const std::vector<double>& y, const std::vector<std::size_t>& kept,
             double x_unit, double y_unit) {
  double out = 0;
  for (std::size_t k = 0; k + 1 < kept.size(); ++k)
    for (std::size_t i = kept[k]; i <= kept[k + 1]; ++i)
      out = std::max(out, apart(x[i] / x_unit, y[i] / y_unit, x[kept[k]] / x_unit, y[kept[k]] / y_unit,
                                x[kept[k + 1]] / x_unit, y[kept[k + 1]] / y_unit));
  return out;
}

TEST(Thinning, NoPointIsFartherFromTheLineThanAsked) {
  std::mt19937 random(5);
  std::normal_distribution<double> normal;
  for (const double roughness : {0., 0.1, 1., 30.}) {
    std::vector<double> x, y;
    for (int i = 0; i < 5000; ++i) {
      const double phase = 2 * pi * i / 1700;
      x.push_back(300 * std::cos(phase) + roughness * normal(random));
      y.push_back(200 * std::sin(2 * phase + 0.3) + roughness * normal(random));
    }
    const auto kept = thin(x, y, 1, 1, 0.5);
    EXPECT_EQ(kept.front(), 0u);
    EXPECT_EQ(kept.back(), x.size() - 1);
    EXPECT_LE(worst(x, y, kept, 1, 1), 0.5 + 1e-9) << roughness;
    EXPECT_TRUE(roughness > 0 || kept.size() < 400u);
  }
}

// A chord of half a pixel's error spans sqrt(8 r / 2) pixels or so of a circle, wherever the samples lie.
TEST(Thinning, KeepsAsManyPointsAsTheLineIsLongAndBent) {
  constexpr double r = 400;
  std::vector<double> x, y;
  for (int i = 0; i <= 200'000; ++i) {
    x.push_back(r * std::cos(2 * pi * i / 200'000));
    y.push_back(r * std::sin(2 * pi * i / 200'000));
  }
  const auto kept = thin(x, y, 1, 1, 0.5);
  EXPECT_GT(kept.size(), 60u);
  EXPECT_LT(kept.size(), 240u);
}

TEST(Thinning, TipsStay) {
  std::vector<double> x, y;
  for (int i = 0; i <= 1000; ++i) x.push_back(i), y.push_back(0);
  for (int i = 999; i >= 0; --i) x.push_back(i), y.push_back(0);
  const auto kept = thin(x, y, 1, 1, 0.5);
  ASSERT_EQ(kept.size(), 3u);
  EXPECT_NEAR(x[kept[1]], 1000, 0.5);
}

TEST(Thinning, GapsBreakTheLine) {
  const std::vector<double> x{0, 1, 2, 3, 4, 5, 6}, y{0, 0, NAN, NAN, 7, 7, 7};
  EXPECT_EQ(thin(x, y, 1, 1, 0.5), (std::vector<std::size_t>{0, 1, 2, 4, 6}));
  const std::vector<double> none{NAN, NAN};
  EXPECT_TRUE(thin(none, none, 1, 1, 0.5).empty());
}

TEST(Thinning, NoiseIsThinnedUntilItFits) {
  std::mt19937 random(7);
  std::normal_distribution<double> normal(0, 3);
  std::vector<double> x, y;
  for (int i = 0; i < 100'000; ++i) {
    x.push_back(i * 0.01);
    y.push_back(normal(random));
  }
  const auto thinned = thin_to(x, y, 1, 1, 0.5, 2000);
  EXPECT_LE(thinned.kept.size(), 2000u);
  EXPECT_GT(thinned.error, 0.5);
  EXPECT_LE(worst(x, y, thinned.kept, 1, 1), thinned.error + 1e-9);
}

// Ten periods, the last a hundred times as fast as the first, sampled evenly in time.
Recording sweep() {
  Recording r;
  r.header = testing::sample_header();
  auto &field = r.set(Channel::field), &x = r.set(Channel::displacement);
  double time = 0;
  for (int period = 0; period < 10; ++period) {
    const double duration = 10 * std::pow(100, -period / 9.);
    const int samples = static_cast<int>(duration * 1000);
    for (int i = 0; i < samples; ++i) {
      const double phase = 2 * pi * i / samples;
      r.time.push_back(time + i * 1e-3);
      field.push_back(1e6 * std::cos(phase));
      x.push_back(1e-5 * std::cos(phase - 0.3));
    }
    time += samples * 1e-3;
  }
  return r;
}

TEST(Figures, RowsUnevenlySpacedAreDrawnWhereTheyAre) {
  const testing::UnevenRows rows;
  constexpr std::size_t pieces = 1200;
  const auto points = band(rows.time, rows.field, pieces);
  EXPECT_LE(points.size(), 4 * pieces);
  const double pixel = rows.time.back() / pieces;
  for (std::size_t k = 0; k + 1 < points.size(); ++k)
    for (double t = points[k][0]; t < points[k + 1][0]; t += pixel / 4) {
      const double share = (t - points[k][0]) / (points[k + 1][0] - points[k][0]);
      const double drawn = points[k][1] + share * (points[k + 1][1] - points[k][1]);
      const double level = rows.level_at(t, 2 * pixel);
      ASSERT_TRUE(std::isnan(level) || std::abs(drawn - level) < 1e-9) << drawn << " at " << t << " s";
    }
}

TEST(Thinning, StretchesAreAsManyAsAskedForWhereRowsAreEven) {
  std::vector<double> time;
  for (int i = 0; i < 100'000; ++i) time.push_back(1e-4 * i);
  for (const std::size_t most : {1u, 7u, 1000u}) EXPECT_EQ(stretches(time, most).size(), most);
  EXPECT_EQ(stretches(time, 200'000).size(), time.size());
  EXPECT_TRUE(stretches({}, 10).empty());
}

TEST(Thinning, NoTimesMakeMoreStretchesThanAskedFor) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> decades(-6, 3);
  for (int k = 0; k < 50; ++k) {
    std::vector<double> time{0};
    for (int i = 1; i < 3000; ++i) time.push_back(time.back() + std::pow(10, decades(random)));
    EXPECT_LE(stretches(time, 100).size(), 100u);
    std::ranges::shuffle(time, random);  // of a file that is none of ours
    EXPECT_LE(stretches(time, 100).size(), 100u);
  }
}

TEST(Figures, ALoopOfASweepIsDrawnCycleByCycleAndSmooth) {
  const auto r = sweep();
  const auto figures = make_figures(r);
  const auto loop = std::ranges::find(figures, "Displacement against field", &Figure::title);
  ASSERT_NE(loop, figures.end());
  std::size_t cycles = 0;
  double last = -1e9;
  for (const auto& series : loop->series) {
    if (series.quiet) continue;
    ++cycles;
    EXPECT_GT(series.value, last) << "the colours follow the frequency";
    last = series.value;
    EXPECT_TRUE(series.label.ends_with(" Hz")) << series.label;
    // Between the points the line may leave the ellipse by no more than the samples do.
    EXPECT_GT(series.points.size(), 40u) << series.label;
  }
  EXPECT_GE(cycles, 9u);
  EXPECT_EQ(loop->note, "");
}

TEST(Figures, ManyCyclesAreShownInPartAndSaySo) {
  Recording r;
  r.header = testing::sample_header();
  auto &field = r.set(Channel::field), &x = r.set(Channel::displacement);
  for (int i = 0; i <= 50 * 200; ++i) {
    r.time.push_back(i * 1e-3);
    field.push_back(1e6 * std::cos(2 * pi * i / 200));
    x.push_back(1e-5 * std::cos(2 * pi * i / 200 - 0.4));
  }
  const auto figures = make_figures(r);
  const auto loop = std::ranges::find(figures, "Displacement against field", &Figure::title);
  ASSERT_NE(loop, figures.end());
  EXPECT_EQ(loop->note, "12 of 50 cycles");
  const auto labelled = [](const Series& s) { return !s.label.empty(); };
  const auto first = std::ranges::find_if(loop->series, labelled);
  EXPECT_EQ(first->label, "cycle 1");
  EXPECT_EQ(loop->series.back().label, "cycle 50");
}

TEST(Figures, CyclesAlikeShareALineOfTheLegend) {
  auto r = testing::play(0, {{1e6, 5}, {0, 5}, {1e6, 1}, {0, 1}, {1e6, 1}, {0, 1}}, 200);
  r.set(Channel::displacement) = r.at(Channel::command);
  const auto figures = make_figures(r);
  const auto loop = std::ranges::find(figures, "Displacement against field", &Figure::title);
  ASSERT_NE(loop, figures.end());
  std::vector<std::string> labels;
  for (const auto& series : loop->series)
    if (!series.label.empty()) labels.push_back(series.label);
  EXPECT_EQ(labels, (std::vector<std::string>{"0.1 Hz", "0.5 Hz"}));
}

TEST(Figures, CreepCurvesNameTheirHold) {
  auto r = testing::play(1.5e6, {{0, 1}, {0, 15}, {1.5e6, 1}, {1.5e6, 5}, {-5e5, 2}, {-5e5, 15}}, 100);
  auto& x = r.set(Channel::displacement);
  for (const double t : r.time) x.push_back(1e-6 * std::log1p(t));
  const auto figures = make_figures(r);
  const auto creep = std::ranges::find(figures, "Creep of the displacement", &Figure::title);
  ASSERT_NE(creep, figures.end());
  ASSERT_EQ(creep->series.size(), 2u);
  EXPECT_EQ(creep->series[0].label, "hold 1: 0 kV/mm");
  EXPECT_EQ(creep->series[1].label, "hold 5: -0.5 kV/mm");
}

}  // namespace
}  // namespace ferrobench::recordings

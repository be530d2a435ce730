// The parametrized polycrystal, calibrated from a slow loop at 4 MPa as in the source's figures 4.26 to 4.31.
// The loops are "measured" on the polycrystal by distribution.
#include <gtest/gtest.h>

#include "model/inference/study/calibrate.h"
#include "model/on_recording.h"
#include "tests/model/measured.h"

namespace ferrobench::model {
namespace {

using recordings::Channel;

constexpr double slow = 0.05e6, fast = 5e6;  // V/m/s
constexpr double top = 1.5e6;                // V/m

Model measured(double prestress) {
  auto m = library_model("soft-pzt");
  m.polycrystal.interaction_field_std = 2e5;  // part of it switches within the actuator's range
  m.polycrystal.interaction_stress_std = 15e6;
  m.load = {.spring_stiffness = 2.7e6, .prestress = prestress};
  return m;
}

// From rest through the levels at one rate.
Program through(const std::vector<double>& levels, double rate) {
  std::vector<std::pair<double, double>> corners{{0, 0}};
  for (const double level : levels)
    corners.emplace_back(corners.back().first + std::abs(level - corners.back().second) / rate, level);
  return {corners, 5e3 / rate};
}

recordings::Recording slow_loop(double prestress) {
  return measured_on(measured(prestress), through({top, 0, top}, slow));
}

Model calibrated() {
  const auto high = slow_loop(16e6);
  return calibrate_parametrized(measured(4e6), slow_loop(4e6), &high);
}

Model at(Model m, double prestress) {
  m.load.prestress = prestress;
  return m;
}

double range(std::span<const double> v) {
  const auto [low, high] = std::minmax_element(v.begin(), v.end());
  return *high - *low;
}

// Of the second cycle of two.
double stroke(const Model& m, double rate) {
  const auto x = run(m, through({top, 0, top, 0, top}, rate)).displacement;
  return range(std::span(x).last(x.size() * 2 / 5));
}

// x+ - x- along a program.
std::vector<double> order(const Model& m, const Program& p) {
  std::vector<double> out;
  Simulator simulator(m);
  simulator.start(0);
  for (std::size_t i = 0; i < p.time.size(); ++i) {
    double plus = 0, minus = 0;
    ChannelSpans spans;
    spans.fraction_plus = {&plus, 1};
    spans.fraction_minus = {&minus, 1};
    simulator.play(p.time[i] - simulator.time(), p.field[i], {&p.time[i], 1}, spans);
    out.push_back(plus - minus);
  }
  return out;
}

TEST(Calibration, GivesItsLoopBack) {
  const auto loop = slow_loop(4e6);
  const auto back = simulate_on(calibrated(), loop);
  EXPECT_LT(apart(loop.at(Channel::displacement), back.displacement), 0.01);
}

// Strain (4.65) takes the few domains that go on to -180 for +180. That, and nothing else, is what the charge
// of the calibration loop is off by.
TEST(Calibration, GivesTheChargeBackButForMinus180) {
  const auto loop = slow_loop(4e6);
  const auto m = calibrated();
  const auto p = through({top, 0, top}, slow);
  const auto was = order(measured(4e6), p), is = order(m, p);
  auto charge = simulate_on(m, loop).charge;
  EXPECT_LT(apart(loop.at(Channel::charge), charge), 0.1);
  const double full =
      static_cast<double>(m.actuator.layer_count) * m.actuator.area * m.material.remanent_polarization;
  for (std::size_t i = 0; i < charge.size(); ++i) charge[i] += full * (was[i] - is[i]);
  EXPECT_LT(apart(loop.at(Channel::charge), charge), 0.005);
}

TEST(Calibration, MakesAFallingTableWithAGap) {
  const auto table = calibrated().polycrystal.critical_force.value();
  EXPECT_EQ(table.unload.front().fraction, 0);
  EXPECT_EQ(table.unload.back().fraction, 1);
  ASSERT_EQ(table.load.size(), table.unload.size());
  for (std::size_t i = 0; i < table.load.size(); ++i) {
    EXPECT_EQ(table.load[i].fraction, table.unload[i].fraction);
    EXPECT_GT(table.unload[i].force - table.load[i].force, 1e5) << table.load[i].fraction;
    if (i == 0) continue;
    EXPECT_LE(table.load[i].force, table.load[i - 1].force) << table.load[i].fraction;
    EXPECT_LE(table.unload[i].force, table.unload[i - 1].force) << table.unload[i].fraction;
  }
}

TEST(Calibration, RefusesALoopThatHardlySwitches) {
  const auto loop = measured_on(measured(4e6), through({top, 1.2e6, top}, slow));
  EXPECT_THROW(calibrate_parametrized(measured(4e6), loop), Error);
}

TEST(Calibration, RefusesALoopThatRepoles) {
  const auto loop = measured_on(measured(4e6), through({top, -top, top}, slow));
  EXPECT_THROW(calibrate_parametrized(measured(4e6), loop), Error);
}

TEST(Figure429, FasterLoopsHaveShorterStrokes) {
  const auto shortening = [](const Model& m) { return 1 - stroke(m, fast) / stroke(m, slow); };
  const double was = shortening(measured(8e6)), is = shortening(at(calibrated(), 8e6));
  EXPECT_GT(was, 0.1);
  EXPECT_NEAR(is, was, 0.25 * was);
}

TEST(Figure430, StrokeGrowsWithPrestress) {
  const auto m = calibrated();
  double last = 0;
  for (const double prestress : {4e6, 8e6, 16e6}) {
    const double was = stroke(measured(prestress), slow), is = stroke(at(m, prestress), slow);
    EXPECT_GT(is, last * 1.05) << prestress;
    EXPECT_NEAR(is, was, 0.05 * was) << prestress;
    last = is;
  }
}

// Minor loops lie inside the major one, and the further down they turn the wider and longer they are.
TEST(Figure431, MinorLoopsNest) {
  const auto m = at(calibrated(), 8e6);
  const auto major = run(m, through({top, 0, top, 0, top}, slow));
  const double leg = (static_cast<double>(major.displacement.size()) - 1) / 5;
  const auto envelope = [&](double field, bool up) {  // the last cycle's branch at this field
    const double u = field / top * leg;
    return major.displacement[static_cast<std::size_t>(std::lround(4 * leg + (up ? u : -u)))];
  };
  const double tolerance = 0.01 * range(major.displacement);
  double last_width = 1e-8;
  for (const double turn : {0.5e6, 0.375e6, 0.25e6, 0.125e6}) {
    const auto p = through({top, 0, top, turn, top, turn, top}, slow);
    const auto x = run(m, p).displacement;
    const auto steps = static_cast<std::size_t>(std::lround(2 * (top - turn) / 5e3));
    const auto minor = std::span(x).last(steps + 1);
    double width = 0;
    for (std::size_t i = 0; i < minor.size(); ++i) {
      const double field = p.field[x.size() - minor.size() + i];
      EXPECT_GT(minor[i], envelope(field, true) - tolerance) << turn << " " << field;
      EXPECT_LT(minor[i], envelope(field, false) + tolerance) << turn << " " << field;
      width = std::max(width, minor[i] - minor[minor.size() - 1 - i]);
    }
    EXPECT_GT(width, 1.5 * last_width) << turn;
    last_width = width;
    const auto was = run(measured(8e6), p).displacement;
    EXPECT_NEAR(range(minor), range(std::span(was).last(steps + 1)), 0.05 * range(minor)) << turn;
  }
}

}  // namespace
}  // namespace ferrobench::model

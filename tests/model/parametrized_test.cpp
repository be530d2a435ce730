// The parametrized polycrystal, calibrated from a slow loop as in the source's figure 4.26. The
// loops are "measured" on the polycrystal by distribution.
#include <gtest/gtest.h>

#include "model/fit/calibrate.h"
#include "model/on_recording.h"
#include "tests/model/effects_support.h"

namespace ferrobench::model {
namespace {

using recordings::Channel;

constexpr double slow = 0.05e6;  // V/m/s

Model measured(double prestress) {
  auto m = library_model("soft-pzt");
  m.polycrystal.interaction_field_std = 2e5;  // part of it switches within the actuator's range
  m.polycrystal.interaction_stress_std = 15e6;
  m.load = {.spring_stiffness = 2.7e6, .prestress = prestress};
  return m;
}

// From rest up, then through the levels at one rate.
Program through(const std::vector<double>& levels, double rate) {
  std::vector<std::pair<double, double>> corners{{0, 0}};
  for (const double level : levels)
    corners.emplace_back(corners.back().first + std::abs(level - corners.back().second) / rate, level);
  return {corners, 5e3 / rate};
}

recordings::Recording measure(double prestress, const Program& p) {
  const auto m = measured(prestress);
  const auto t = run(m, p);
  recordings::Recording r;
  r.header.specimen = {m.name, m.actuator.length, m.actuator.area, m.actuator.layer_thickness,
                       m.actuator.layer_count};
  r.header.load = {m.load.spring_stiffness, m.load.prestress};
  r.time = p.time;
  r.set(Channel::command) = p.field;
  r.set(Channel::field) = t.field;
  r.set(Channel::charge) = t.charge;
  r.set(Channel::displacement) = t.displacement;
  r.set(Channel::force) = t.force;
  return r;
}

const std::vector<double> loop_levels{1.5e6, 0, 1.5e6};

Model calibrated() {
  const auto low = measure(4e6, through(loop_levels, slow)), high = measure(16e6, through(loop_levels, slow));
  return calibrate_parametrized(measured(4e6), low, &high);
}

TEST(Calibration, GivesItsLoopBack) {
  const auto loop = measure(4e6, through(loop_levels, slow));
  const auto back = simulate_on(calibrated(), loop);
  std::printf("  displacement %.2e charge %.2e\n", apart(loop.at(Channel::displacement), back.displacement),
              apart(loop.at(Channel::charge), back.charge));
  EXPECT_LT(apart(loop.at(Channel::displacement), back.displacement), 0.03);
}

}  // namespace
}  // namespace ferrobench::model

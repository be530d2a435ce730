#include <gtest/gtest.h>

#include <numbers>

#include "model/physics/oscillator.h"
#include "tests/model/effects_support.h"

namespace ferrobench::model {
namespace {

// No spring, no switching: what is left is linear.
Model free_crystal() {
  auto m = crystal();
  m.load.spring_stiffness = 0;
  return m;
}
Program positive_hold() {
  return {{{0, 0}, {0.001, 1e6}, {3.001, 1e6}}, 1e-3};
}

Ports installed(const std::string& id, const std::vector<double>& values) {
  Model m;
  Ports ports;
  find_effect(id).install(values, m, ports);
  return ports;
}

double total(const std::vector<FieldPiece>& pieces) {
  double sum = 0;
  for (const auto& p : pieces) sum += p.duration;
  return sum;
}

TEST(AmplifierLag, ChordsFollowTheExponential) {
  constexpr double tau = 0.01, slope = 2e7;
  const auto ports = installed("amplifier_lag", {tau});
  std::vector<FieldPiece> out;
  ports.drive[0]->start(0);
  ports.drive[0]->transform({0.1, 0, 0.1 * slope}, out);
  EXPECT_NEAR(total(out), 0.1, 1e-15);
  EXPECT_LT(out.size(), 250U);
  double t = 0;
  const auto exact = [](double at) { return slope * (at - tau + tau * std::exp(-at / tau)); };
  for (const auto& p : out) {
    EXPECT_NEAR(p.from, exact(t), 1e-6);
    EXPECT_NEAR(0.5 * (p.from + p.to), exact(t + 0.5 * p.duration), 20);
    t += p.duration;
  }
  EXPECT_NEAR(out.back().to, exact(0.1), 1e-6);
}

TEST(AmplifierLag, PiecesAreBoundedForAnyTimeConstant) {
  for (const double tau : {1e-15, 1e-6, 1.0, 1e9}) {
    const auto ports = installed("amplifier_lag", {tau});
    std::vector<FieldPiece> out;
    ports.drive[0]->start(0);
    ports.drive[0]->transform({1, 1e8, -1e8}, out);
    EXPECT_LT(out.size(), 300U) << tau;
    EXPECT_NEAR(total(out), 1, 1e-12);
  }
}

TEST(AmplifierSlewLimit, CatchesUpInACorner) {
  const auto ports = installed("amplifier_slew_limit", {1e6});
  std::vector<FieldPiece> out;
  ports.drive[0]->start(0);
  ports.drive[0]->transform({1, 0, 2e6}, out);
  ports.drive[0]->transform({2, 2e6, 2e6}, out);
  ports.drive[0]->transform({1, 2e6, 1.5e6}, out);
  ASSERT_EQ(out.size(), 4U);
  EXPECT_EQ(out[0].to, 1e6);
  EXPECT_DOUBLE_EQ(out[1].duration, 1);
  EXPECT_DOUBLE_EQ(out[1].to, 2e6);
  EXPECT_DOUBLE_EQ(out[2].duration, 1);
  EXPECT_EQ(out[3].to, 1.5e6);
}

TEST(Oscillator, TwoHalvesAreTheWholeAndEnergyStays) {
  for (const double damping : {0.0, 0.1, 2.0, 2.0000001, 50.0}) {
    const Oscillator o{.mass = 1, .damping = damping, .stiffness = 1};
    const Motion from{0.3, -0.2};
    const auto whole = swing(o, from, 1, 3, 1.7);
    const auto halves = swing(o, swing(o, from, 1, 2, 0.85), 2, 3, 0.85);
    EXPECT_NEAR(whole.position, halves.position, 1e-7) << damping;
    EXPECT_NEAR(whole.velocity, halves.velocity, 1e-7) << damping;
    const auto late = swing(o, from, 1, 1, 1e6);
    if (damping > 0) {
      EXPECT_NEAR(late.position, 1, 1e-9) << damping;
    }
  }
  const Oscillator o{.mass = 2, .damping = 0, .stiffness = 5};
  const auto end = swing(o, {0.3, -0.2}, 0, 0, 123.4);
  EXPECT_NEAR(5 * end.position * end.position + 2 * end.velocity * end.velocity, 5 * 0.09 + 2 * 0.04, 1e-12);
}

TEST(LogarithmicCreep, HeldStrainCreepsByTheSumOfItsLags) {
  const auto p = positive_hold();
  const auto base = run(free_crystal(), p);
  const auto out = run(with(free_crystal(), "logarithmic_creep", {{"fraction_per_decade", 0.02}}), p);
  const double held = base.displacement.back();
  double sum = 0;
  for (const double tau : {0.1, 1.0, 10.0, 100.0, 1000.0}) sum += 0.02 * -std::expm1(-3.0005 / tau);
  EXPECT_NEAR(out.displacement.back() / held - 1, sum, 1e-5);
}

// The specimen switches as one without the effect does in the field that its domains see.
TEST(MeanFieldInteraction, IsTheBaseModelInTheFieldThatItsDomainsSee) {
  auto m = free_crystal();
  m.load.prestress = 0;
  m.material.permittivity_90 = m.material.permittivity_180;
  const double plates = static_cast<double>(m.actuator.layer_count) * m.actuator.area,
               permittivity = m.material.permittivity_180;
  for (const double coefficient : {-5e5, 1e6}) {
    const Program p({{0, 0}, {0.1, -2e6}, {0.3, 2e6}, {0.4, 0}, {0.5, 0}}, 1e-4);
    const auto out = run(with(m, "mean_field_interaction", {{"coefficient", coefficient}}), p);
    // P_irr from the charge, which at the start is that of the specimen poled towards +.
    const auto switched = [&](const Trajectory& t, const std::vector<double>& field, std::size_t i) {
      return m.material.remanent_polarization + (t.charge[i] - t.charge[0]) / plates -
             permittivity * (field[i] - field[0]);
    };
    auto seen = p;
    std::vector<double> with_it, without;
    for (std::size_t i = 0; i < p.time.size(); ++i) {
      with_it.push_back(switched(out, p.field, i));
      seen.field[i] += coefficient * with_it.back();
    }
    const auto base = run(m, seen);
    for (std::size_t i = 0; i < p.time.size(); ++i) without.push_back(switched(base, seen.field, i));
    EXPECT_LT(apart(with_it, without), 1e-3) << coefficient;
  }
}

// A poled specimen under a prestress that turns its domains at once: without drag their rates at the start
// are many kT away from those that the drag allows. It slows what follows, and changes nothing of its end.
TEST(DomainWallDrag, SetsOutUnderAPrestress) {
  auto m = crystal();
  m.load.prestress = 6e7;
  m.load.spring_stiffness = 0;
  const Program rest{{{0, 0}, {0.5, 0}}, 1e-3};
  const auto free = run(m, rest), slowed = run(with(m, "domain_wall_drag", {{"coefficient", 2e4}}), rest);
  const auto turned = [](const Trajectory& t, std::size_t row) {
    return t.displacement[row] - t.displacement[0];
  };
  const std::size_t end = free.displacement.size() - 1;
  ASSERT_GT(std::abs(turned(free, end)), 1e-6);
  EXPECT_LT(std::abs(turned(slowed, 1)), 0.9 * std::abs(turned(free, 1)));
  EXPECT_NEAR(turned(slowed, end), turned(free, end), 1e-3 * std::abs(turned(free, end)));
}

TEST(ViscoelasticCreep, NothingWithoutChangeOfStress) {
  const auto p = positive_hold();
  const auto base = run(free_crystal(), p);
  const auto out =
      run(with(free_crystal(), "viscoelastic_creep", {{"compliance", 1e-11}, {"time_constant", 1}}), p);
  EXPECT_LT(apart(base.displacement, out.displacement), 1e-9);
}

TEST(DielectricLeakage, ChargeGrowsWithTheIntegralOfTheField) {
  const auto p = positive_hold();
  const auto base = run(free_crystal(), p),
             out = run(with(free_crystal(), "dielectric_leakage", {{"resistivity", 1e9}}), p);
  const auto a = crystal().actuator;
  EXPECT_NEAR(out.charge.back() - base.charge.back(),
              static_cast<double>(a.layer_count) * a.area * 3.0005e6 / 1e9, 1e-12);
}

TEST(ChargeAmplifierDecay, RestDecaysExponentially) {
  const auto out = run(with(free_crystal(), "charge_amplifier_decay", {{"time_constant", 0.4}}), rest());
  EXPECT_NEAR(out.charge.back() / out.charge.front(), std::exp(-1 / 0.4), 1e-8);
}

TEST(PrestressRelaxation, ForceFallsWithTimeAlone) {
  const auto out =
      run(with(free_crystal(), "prestress_relaxation", {{"fraction", 0.3}, {"time_constant", 0.5}}), rest());
  const double full = crystal().load.prestress * crystal().actuator.area;
  EXPECT_NEAR(out.force.back(), full * (1 + 0.3 * std::expm1(-2.0)), 1e-6 * full);
}

// Once the guide slides, its force holds back as one on the stiffness of spring and actuator.
TEST(GuideFriction, SlidingShiftsByForceOverStiffness) {
  auto m = crystal();
  m.material.compliance_90 = m.material.compliance_180;
  const auto base = run(m, unipolar());
  const auto out = run(with(m, "guide_friction", {{"force", 20}, {"presliding_distance", 1e-8}}), unipolar());
  const double stiffness =
      m.load.spring_stiffness + m.actuator.area / (m.material.compliance_180 * m.actuator.length);
  EXPECT_NEAR(base.displacement[90] - out.displacement[90], 20 / stiffness, 1e-4 * 20 / stiffness);
  EXPECT_NEAR(base.displacement[150] - out.displacement[150], -20 / stiffness, 1e-4 * 20 / stiffness);
}

TEST(LoadCellCreep, HeldForceCreepsFromRest) {
  const auto p = positive_hold();
  const auto base = run(crystal(), p);
  const auto out = run(with(crystal(), "load_cell_creep", {{"fraction", 0.1}, {"time_constant", 1}}), p);
  const double rest_force = crystal().load.prestress * crystal().actuator.area;
  EXPECT_NEAR((out.force.back() - base.force.back()) / (base.force.back() - rest_force),
              -0.1 * std::expm1(-3.0005), 1e-5);
}

TEST(DisplacementSensors, DoWhatTheirFormulasSay) {
  const auto p = loop();
  const auto x = run(crystal(), p).displacement;
  const auto check = [&](const std::string& id, const Parameters& parameters, auto expected,
                         double tolerance) {
    const auto out = run(with(crystal(), id, parameters), p).displacement;
    for (std::size_t i = 0; i < x.size(); ++i) EXPECT_NEAR(out[i], expected(i), tolerance) << id << " " << i;
  };
  check(
      "displacement_drift", {{"rate", 1e-5}}, [&](auto i) { return x[i] + 1e-5 * p.time[i]; }, 1e-15);
  check(
      "displacement_crosstalk", {{"coefficient", 1e-12}}, [&](auto i) { return x[i] + 1e-12 * p.field[i]; },
      1e-15);
  check(
      "displacement_clipping", {{"limit", 5e-6}}, [&](auto i) { return std::clamp(x[i], -5e-6, 5e-6); },
      1e-15);
  check(
      "displacement_nonlinearity", {{"coefficient", 1e3}}, [&](auto i) { return x[i] * (1 + 1e3 * x[i]); },
      1e-15);
  check(
      "mains_pickup", {{"amplitude", 1e-7}, {"frequency", 50}},
      [&](auto i) { return x[i] + 1e-7 * std::sin(100 * std::numbers::pi * p.time[i]); }, 1e-15);
  check(
      "displacement_delay", {{"delay", 0.01}}, [&](auto i) { return x[i < 10 ? 0 : i - 10]; }, 1e-10);
}

TEST(DisplacementSensors, LagHoldsItsAccuracyBetweenFarOutputs) {
  const std::vector<std::pair<double, double>> corners{{0, 0}, {0.1, -2e6}, {0.3, 2e6}, {0.4, 0}, {0.5, 0}};
  const auto m = with(crystal(), "displacement_lag", {{"time_constant", 5e-3}});
  const auto far = run(m, Program(corners, 0.05)), near = run(m, Program(corners, 1e-4));
  for (std::size_t i = 0; i < far.displacement.size(); ++i)
    EXPECT_NEAR(far.displacement[i], near.displacement[500 * i], 1e-8) << i;
}

TEST(StageInertia, LongHoldsAreCheap) {
  Simulator s(with(crystal(), "stage_inertia", {{"mass", 0.1}, {"damping_ratio", 0.01}}));
  s.start(0);
  s.play(0.002, -2e6, {}, {});
  s.play(1e5, -2e6, {}, {});
  EXPECT_LT(s.statistics().steps, 20000U);
}

TEST(Parametrized, RefusesEffectsOnDomains) {
  auto m = crystal();
  m.polycrystal.method = PolycrystalMethod::parametrized;
  m.polycrystal.critical_force = CriticalForce{
      .unload = {{0, 0}, {1, 1}}, .load = {{0, 0}, {1, 1}}, .prestress = 0, .prestress_shift = 0};
  for (const auto* id : {"barrier_distribution", "interaction_field_distribution", "internal_bias_field",
                         "stress_stabilized_90"})
    EXPECT_THROW(Simulator(with(m, id, {{std::string(find_effect(id).parameters[0].name), 1e-9}})), Error)
        << id;
}

}  // namespace
}  // namespace ferrobench::model

// Empirical terms in closed form, off to the bit, and never a candidate.
#include <gtest/gtest.h>

#include <numbers>

#include "model/inference/report/empirical_picture.h"
#include "model/inference/selection/candidates.h"
#include "tests/model/empirical_reference.h"

namespace ferrobench::model {
namespace {

constexpr double scale = 1e6;
constexpr std::array radii{0.05, 0.1, 0.2, 0.35, 0.5, 0.75};

// All of a term's numbers zero but those given; amplitude and scales stand at `scale` and the like.
std::vector<double> values_of(const std::string& id, const Parameters& given) {
  std::vector<double> out;
  for (const auto& p : find_effect(id).parameters) {
    out.push_back(p.name == "amplitude"         ? 1
                  : p.name == "field_scale"     ? scale
                  : p.name == "extension_scale" ? 1e-5
                  : p.name == "time_constant"   ? 1
                                                : 0);
    for (const auto& [name, value] : given)
      if (name == p.name) out.back() = value;
  }
  return out;
}
Parameters named(const std::string& id, const Parameters& given) {
  Parameters out;
  const auto values = values_of(id, given);
  for (std::size_t i = 0; i < values.size(); ++i)
    out.emplace_back(find_effect(id).parameters[i].name, values[i]);
  return out;
}
Ports installed(const std::string& id, const Parameters& given) {
  Model m;
  Ports ports;
  find_effect(id).install(values_of(id, given), m, ports);
  return ports;
}

// The three terms with the material's state, each in its port.
class OfTheMaterial : public testing::TestWithParam<std::string> {
 protected:
  static MaterialTerm<double>& term(Ports& ports) {
    return GetParam() == "empirical_strain"         ? *ports.strain.at(0)
           : GetParam() == "empirical_polarization" ? *ports.polarization.at(0)
                                                    : *ports.seen_by_rates.at(0);
  }
};
INSTANTIATE_TEST_SUITE_P(Empirical, OfTheMaterial,
                         testing::Values("empirical_strain", "empirical_polarization", "empirical_rate"),
                         [](const auto& i) { return i.param; });

MaterialState<double> state(double e, double plus = 1, double minus = 0) {
  MaterialState<double> out;
  out.field = e * scale;
  out.plus = plus;
  out.minus = minus;
  return out;
}

TEST_P(OfTheMaterial, TablesAreStraightBetweenTheirKnotsAndLevelBeyond) {
  auto ports = installed(GetParam(), {{"amplitude", 2},
                                      {"field_1", 3},
                                      {"field_4", 10},
                                      {"field_8", -1},
                                      {"order_0", 5},
                                      {"order_3", 7},
                                      {"ninety_1", 0.5},
                                      {"ninety_4", 4}});
  auto& t = term(ports);
  t.start(state(0));
  // At rest f is 10, g and q are nothing.
  const auto f = [&](double e) { return t.propose(1, state(e, 0.5, 0.5)) / 2 + 10; };
  EXPECT_NEAR(f(-0.75), 3, 1e-12);
  EXPECT_NEAR(f(0), 10, 1e-12);
  EXPECT_NEAR(f(0.1), 6, 1e-12);
  EXPECT_NEAR(f(0.875), -0.5, 1e-12);
  EXPECT_NEAR(f(1), -1, 1e-12);
  EXPECT_NEAR(f(40), -1, 1e-12);
  // p = 0.4, n = 0.2.
  const auto all = [&](double e) { return t.propose(1, state(e, 0.6, 0.2)) / 2 + 10; };
  EXPECT_NEAR(all(-1), 0.4 * 5, 1e-12);
  EXPECT_NEAR(all(-9), 0.4 * 5, 1e-12);
  EXPECT_NEAR(all(0.25), 0 + 0.4 * 3.5, 1e-12);
  EXPECT_NEAR(all(-0.5), 0 + 0.2 * 0.5, 1e-12);
  EXPECT_NEAR(all(0.75), 0 + 0.4 * 3.5 + 0.2 * 2, 1e-12);
}

// Long steps from turn to turn are what tiny ones add up to.
TEST_P(OfTheMaterial, PlaysFollowAnyWayOfTheField) {
  Parameters weights;
  std::map<std::string, double> plain{{"t.amplitude", 1}, {"t.field_scale", scale}};
  for (std::size_t j = 0; j < radii.size(); ++j) {
    weights.emplace_back("play_" + std::to_string(j), 1 + static_cast<double>(j));
    plain["t." + weights.back().first] = weights.back().second;
  }
  auto ports = installed(GetParam(), weights);
  auto& t = term(ports);
  PlainTerm tiny(plain, "t");
  t.start(state(0));
  tiny.start(0, 1, 0);
  double e = 0;
  for (const double to : {0.3, -0.2, 1.4, 0.9, 0.95, -0.4, 2.0, -2.0, -1.9, 0.1, 0.1, 0.0}) {
    for (int i = 1; i <= 1000; ++i) tiny.step(1e-3, scale * (e + (to - e) * i / 1000), 1, 0);
    e = to;
    t.accept(1, state(e));
    EXPECT_NEAR(t.propose(0, state(e)), tiny.beyond_start(), 1e-12) << e;
  }
}

// Between -a and a a play of radius r < a goes around a parallelogram, 2 r wide and 2 (a - r) high; within
// its dead zone it does nothing.
TEST_P(OfTheMaterial, APlaysLoopHasItsArea) {
  for (std::size_t j = 0; j < radii.size(); ++j)
    for (const double a : {0.08, 0.4, 0.9}) {
      auto ports = installed(GetParam(), {{"play_" + std::to_string(j), 3}});
      auto& t = term(ports);
      t.start(state(0));
      double area = 0, before = 0, e = 0;
      const int n = 2000;
      for (int cycle = 0; cycle < 2; ++cycle) {
        area = 0;
        for (int i = 1; i <= n; ++i) {
          const double to = a * std::sin(2 * std::numbers::pi * i / n);
          t.accept(1, state(to));
          const double value = t.propose(0, state(to));
          area += 0.5 * (to + e) * (value - before);
          before = value;
          e = to;
        }
      }
      const double r = radii[j];
      EXPECT_NEAR(area, a > r ? 12 * r * (a - r) : 0, 1e-3) << r << " " << a;
    }
}

TEST_P(OfTheMaterial, LagsAreExactForRampsAndHolds) {
  constexpr double tau = 0.4;
  auto ports = installed(GetParam(),
                         {{"time_constant", tau}, {"lag_field", 1}, {"lag_order", 10}, {"lag_ninety", 100}});
  auto& t = term(ports);
  t.start(state(0));
  // In 1 s all the way to e = 0.5, p = 0.2, n = 0.4, then held.
  t.accept(1, state(0.5, 0.4, 0.2));
  const double ramp = 1 - tau * -std::expm1(-1 / tau);
  const double full = 0.5 - 10 * 0.8 + 100 * 0.4;
  EXPECT_NEAR(t.propose(0, state(0.5, 0.4, 0.2)), ramp * full, 1e-12);
  for (const double h : {1e-6, 0.1, 2.0, 1e4})
    EXPECT_NEAR(t.propose(h, state(0.5, 0.4, 0.2)), (1 + (ramp - 1) * std::exp(-h / tau)) * full, 1e-12) << h;
}

TEST_P(OfTheMaterial, ProposalsAreForgottenAndHalvesMakeTheWhole) {
  Model m;
  Ports ports;
  std::vector<double> values;
  for (const auto& [name, value] : empirical_values(GetParam(), 1, 0.3)) values.push_back(value);
  values[1] = scale;
  find_effect(GetParam()).install(values, m, ports);
  auto& t = term(ports);
  t.start(state(0.1));
  t.accept(0.2, state(0.8, 0.7, 0.1));
  const double whole = t.propose(0.6, state(-0.4, 0.3, 0.3));
  t.propose(5, state(3, 0, 1));
  EXPECT_EQ(t.propose(0.6, state(-0.4, 0.3, 0.3)), whole);
  t.accept(0.3, state(0.2, 0.5, 0.2));
  EXPECT_NEAR(t.propose(0.3, state(-0.4, 0.3, 0.3)), whole, 1e-12);
}

// Strain and polarization count from the start; what the rates see is nothing in the poled specimen at no
// field.
TEST_P(OfTheMaterial, IsNothingAtRest) {
  Model m;
  Ports ports;
  std::vector<double> values;
  for (const auto& [name, value] : empirical_values(GetParam(), 1, 0.3)) values.push_back(value);
  find_effect(GetParam()).install(values, m, ports);
  auto& t = term(ports);
  t.start(state(0));
  EXPECT_EQ(t.propose(0, state(0)), 0);
  EXPECT_NEAR(t.propose(9, state(0)), 0, 1e-14);
  t.start(state(-0.7, 0.2, 0.3));
  if (GetParam() == "empirical_rate")
    EXPECT_GT(std::abs(t.propose(0, state(-0.7, 0.2, 0.3))), 0.1);
  else
    EXPECT_EQ(t.propose(0, state(-0.7, 0.2, 0.3)), 0);
}

// A term that is the field itself: the rates see the field times 1.2, as if another one had been applied.
TEST(EmpiricalRate, ThatIsAShareOfTheFieldScalesWhatTheRatesSee) {
  auto m = crystal();
  m.load.spring_stiffness = 0;
  Parameters shares{{"field_scale", 4e6}, {"amplitude", 0.2 * 4e6}};
  for (int i = 0; i < 9; ++i) shares.emplace_back("field_" + std::to_string(i), -1 + 0.25 * i);
  const std::vector<double> time{0, 0.1, 0.3, 0.5}, field{0, -1.6e6, 1.7e6, 1.7e6};
  std::vector<double> stronger, times;
  for (const double e : field) stronger.push_back(1.2 * e);
  for (int i = 0; i <= 100; ++i) times.push_back(0.005 * i);
  std::vector<double> seen(times.size()), applied(times.size());
  ChannelSpans out;
  const SimulationOptions fine{.tolerance = 1e-6};
  out.fraction_plus = seen;
  simulate_at(with(m, "empirical_rate", named("empirical_rate", shares)), time, field, times, out, fine);
  out.fraction_plus = applied;
  simulate_at(m, time, stronger, times, out, fine);
  for (std::size_t i = 0; i < times.size(); ++i) EXPECT_NEAR(seen[i], applied[i], 1e-4) << times[i];
}

TEST(EmpiricalDrive, GivesItsOutputExactly) {
  Parameters given{{"amplitude", 5e4}};
  std::map<std::string, double> plain{{"t.amplitude", 5e4}, {"t.field_scale", scale}};
  for (const auto& [name, value] : empirical_values("empirical_drive", 1, 1))
    if (name.starts_with("field_") || name.starts_with("play_"))
      if (name != "field_scale") {
        given.emplace_back(name, value);
        plain["t." + name] = value;
      }
  const auto ports = installed("empirical_drive", given);
  PlainTerm tiny(plain, "t");
  tiny.start(0, 1, 0);
  EXPECT_EQ(ports.drive[0]->start(0), 0);
  double from = 0, last = 0;
  for (const double to : {0.3e6, -1.7e6, -1.7e6, 0.6e6, 0.4e6, 0.5e6, -0.1e6}) {
    std::vector<FieldPiece> out;
    ports.drive[0]->transform({2, from, to}, out);
    EXPECT_LE(out.size(), 16U);
    double done = 0;
    for (const auto& piece : out) {
      EXPECT_EQ(piece.from, last);
      last = piece.to;
      for (int i = 1; i <= 100; ++i) {
        const double field = from + (to - from) * (done + piece.duration * i / 100) / 2;
        tiny.step(1e-3, field, 1, 0);
        EXPECT_NEAR(piece.from + (piece.to - piece.from) * i / 100, field + tiny.beyond(0, 0, 0), 1e-4);
      }
      done += piece.duration;
    }
    EXPECT_NEAR(done, 2, 1e-12);
    from = to;
  }
}

// A recording that begins away from no field: what comes out of the amplifier is there from the first sample.
TEST(EmpiricalDrive, ActsFromTheFirstSample) {
  const auto m =
      with(crystal(), "empirical_drive", named("empirical_drive", {{"amplitude", 1e4}, {"field_6", 1}}));
  const auto out = run(m, {{{0, 5e5}, {0.1, 5e5}}, 1e-2});
  for (const double e : out.field) EXPECT_NEAR(e, 5.1e5, 1e-6);
}

// The load cell sees k (x + u), with u by where x has been; a memory that went along with steps that were
// only tried would show.
TEST(EmpiricalSpring, TheForceFollowsTheWayOfTheExtension) {
  const auto values = empirical_values("empirical_spring", 1e-6, 0);
  std::map<std::string, double> plain;
  for (const auto& [name, value] : values) plain["empirical_spring." + name] = value;
  const auto m = with(crystal(), "empirical_spring", values);
  PlainTerm term(plain, "empirical_spring");
  const auto out = run(m, loop());
  double most = 0;
  for (std::size_t i = 0; i < out.force.size(); ++i) {
    term.step(0, out.displacement[i], 1, 0);
    const double u = term.beyond(0, 0, 0), expected = m.load.prestress * m.actuator.area +
                                                      m.load.spring_stiffness * (out.displacement[i] + u);
    most = std::max(most, std::abs(m.load.spring_stiffness * u));
    EXPECT_NEAR(out.force[i], expected, 1e-3 * m.load.spring_stiffness * 1e-6) << i;
  }
  EXPECT_GT(most, 1);
}

TEST(EmpiricalSpring, WithoutAnySpringIsNothing) {
  auto m = crystal();
  m.load.spring_stiffness = 0;
  const auto off = run(m, loop()),
             on = run(with(m, "empirical_spring", empirical_values("empirical_spring", 1e-6, 0)), loop());
  EXPECT_LT(apart(off.displacement, on.displacement), 1e-9);
  EXPECT_LT(apart(off.charge, on.charge), 1e-9);
}

class EachEmpirical : public testing::TestWithParam<std::string> {};
INSTANTIATE_TEST_SUITE_P(Empirical, EachEmpirical,
                         testing::Values("empirical_strain", "empirical_polarization", "empirical_rate",
                                         "empirical_drive", "empirical_spring"),
                         [](const auto& i) { return i.param; });

// Not a bit of any channel moves, whatever the weights are, alone and beside effects that are solved for.
TEST_P(EachEmpirical, WithoutAmplitudeIsTheBaseModelToTheBit) {
  auto free = crystal(), many = crystal();
  free.load.spring_stiffness = 0;
  many.polycrystal.method = PolycrystalMethod::distribution;
  many.polycrystal.barrier_log_std = 0.3;
  many.polycrystal.interaction_field_std = 1e5;
  const auto resistive = with(crystal(), "source_resistance", {{"coefficient", 2e4}}),
             creeping = with(with(crystal(), "logarithmic_creep", {{"fraction_per_decade", 0.02}}),
                             "domain_wall_drag", {{"coefficient", 1e4}});
  for (const auto& base : {crystal(), free, many, resistive, creeping}) {
    const auto off = with(base, GetParam(), empirical_values(GetParam(), 0, 0.1));
    const auto a = run(base, loop()), b = run(off, loop());
    EXPECT_EQ(a.field, b.field);
    EXPECT_EQ(a.charge, b.charge);
    EXPECT_EQ(a.displacement, b.displacement);
    EXPECT_EQ(a.force, b.force);
  }
}

TEST_P(EachEmpirical, IsInTheCatalogueAndIsNoCandidate) {
  EXPECT_TRUE(find_effect(GetParam()).empirical);
  EXPECT_NE(find_effect(GetParam()).equation.find("not physics"), std::string_view::npos);
  for (const auto* candidate : inference::candidates_of(crystal(), {})) EXPECT_FALSE(candidate->empirical);
  try {
    inference::candidates_of(crystal(), {"electrostriction", GetParam()});
    FAIL();
  } catch (const Error& e) {
    EXPECT_EQ(e.code(), ErrorCode::invalid_params);
    EXPECT_NE(std::string(e.what()).find("empirical"), std::string::npos);
  }
}

// Behind a source resistance the field across the material is itself unknown; finer steps change nothing.
TEST(EmpiricalRate, GoesWithDragAndResistance) {
  auto m = with(crystal(), "empirical_rate", empirical_values("empirical_rate", 5e4, 0.05));
  m.effects.push_back({"domain_wall_drag", {{"coefficient", 1e4}}});
  m.effects.push_back({"source_resistance", {{"coefficient", 2e4}}});
  const auto p = loop();
  const auto coarse = run(m, p), fine = simulate(m, p.time, p.field, {.tolerance = 1e-6});
  EXPECT_LT(apart(fine.charge, coarse.charge), 1e-3);
  EXPECT_LT(apart(fine.displacement, coarse.displacement), 1e-3);
}

TEST(EmpiricalPicture, HasWhatTheTableAddsInItsUnit) {
  const auto strain = picture_of_empirical(
      {"empirical_strain", named("empirical_strain", {{"amplitude", 2e-6}, {"field_8", 1}, {"order_4", 3}})});
  ASSERT_EQ(strain.series.size(), 3U);
  const auto at_top = [](const recordings::Series& s) {
    return *std::ranges::max_element(s.points, {}, [](const auto& p) { return p[0]; });
  };
  // 2 (f(1) + p g(1)) in 1e-6 for p = 1, -1 and 0, against 1 kV/mm.
  EXPECT_NEAR(at_top(strain.series[0])[0], 1, 1e-9);
  EXPECT_NEAR(at_top(strain.series[0])[1], 8, 1e-9);
  EXPECT_NEAR(at_top(strain.series[1])[1], -4, 1e-9);
  EXPECT_NEAR(at_top(strain.series[2])[1], 2, 1e-9);
  const auto drive = picture_of_empirical(
      {"empirical_drive", named("empirical_drive", {{"amplitude", 1e4}, {"play_0", 1}})});
  ASSERT_EQ(drive.series.size(), 1U);
  EXPECT_NEAR(at_top(drive.series[0])[1], 1e-2 * 0.95, 1e-9);
  const auto spring = picture_of_empirical(
      {"empirical_spring", named("empirical_spring", {{"amplitude", 2e-6}, {"extension_8", 3}})});
  ASSERT_EQ(spring.series.size(), 1U);
  EXPECT_EQ(spring.x_label, "displacement [µm]");
  EXPECT_NEAR(at_top(spring.series[0])[0], 10, 1e-9);
  EXPECT_NEAR(at_top(spring.series[0])[1], 6, 1e-9);
}

}  // namespace
}  // namespace ferrobench::model

// Laws that the physics obeys whatever its constants.
#include <gtest/gtest.h>

#include <array>

#include "model/physics/barrier.h"
#include "model/physics/domains.h"
#include "model/physics/wells.h"
#include "tests/model/random_models.h"
#include "tests/model/student_quantiles.h"

namespace ferrobench::model {
namespace {

TEST(Barrier, ObeysDetailedBalance) {
  for (int i = -86; i <= 86; ++i) {
    const double force = 7e3 * i;
    EXPECT_NEAR(barrier_equal_curvature(force, 5e4) - barrier_equal_curvature(-force, 5e4), -force, 1e-6);
    for (const double other : {1.5e-8, 2.5e-8, 3.5e-8})
      EXPECT_NEAR(barrier_unequal_curvature(force, 5e4, 0.3, 2.5e-8, other, false) -
                      barrier_unequal_curvature(force, 5e4, 0.3, 2.5e-8, other, true),
                  -force, 1e-4);
  }
}

TEST(Fractions, StayFractions) {
  Draw draw(5);
  for (int i = 0; i < 10; ++i) {
    Simulator simulator(draw.model());
    simulator.start(0);
    for (int k = 1; k <= 50; ++k) {
      const double time = 0.1 * k;
      double plus = -1, minus = -1;
      ChannelSpans out;
      out.fraction_plus = {&plus, 1};
      out.fraction_minus = {&minus, 1};
      simulator.play(time - simulator.time(), draw.between(-2e6, 2e6), {&time, 1}, out);
      EXPECT_GE(plus, -1e-9);
      EXPECT_GE(minus, -1e-9);
      EXPECT_LE(plus + minus, 1 + 1e-9);
    }
  }
}

TEST(Simulation, EndsAtItsBoundOfSteps) {
  const std::array<double, 3> time{0, 1, 2}, field{0, 2e6, -2e6};
  const auto model = library_model("soft-pzt");
  std::array<double, 3> charge{};
  ChannelSpans out;
  out.charge = charge;
  const auto took = simulate_at(model, time, field, time, out, {});
  EXPECT_GE(took.tried, took.steps);
  EXPECT_NO_THROW(simulate_at(model, time, field, time, out, {.most_steps = took.tried}));
  try {
    simulate_at(model, time, field, time, out, {.most_steps = took.tried / 2});
    FAIL() << "took more steps than it may";
  } catch (const Error& e) {
    EXPECT_EQ(e.code(), ErrorCode::numerical);
  }
}

// The lattice of three spreads, for models that lack one: as right as their own, and no jump as it is
// switched on.
TEST(Quadrature, DoesNotJumpWhereASpreadIsSwitchedOn) {
  std::vector<double> time, field;
  for (int i = 0; i <= 200; ++i) {
    time.push_back(0.02 * i);
    field.push_back(1.5e6 * std::sin(M_PI * time.back()));
  }
  const auto rms = [](const std::vector<double>& a, const std::vector<double>& b) {
    const auto [low, high] = std::ranges::minmax(a);
    double sum = 0;
    for (std::size_t i = 0; i < a.size(); ++i) sum += (a[i] - b[i]) * (a[i] - b[i]);
    return std::sqrt(sum / static_cast<double>(a.size())) / (high - low);
  };
  using Spread = double Polycrystal::*;
  const auto spreads = {std::pair<Spread, double>{&Polycrystal::barrier_log_std, 1e-9},
                        {&Polycrystal::interaction_field_std, 1e-3},
                        {&Polycrystal::interaction_stress_std, 1e-2}};
  for (const auto& [spread, hardly] : spreads) {
    auto model = library_model("soft-pzt");
    model.polycrystal.barrier_log_std = 0.3;
    model.polycrystal.interaction_field_std = 6e4;
    model.polycrystal.interaction_stress_std = 5e6;
    const SimulationOptions every{.tolerance = 1e-6, .domains = 1000, .every_spread = true};
    model.polycrystal.*spread = 0;
    const auto without = simulate(model, time, field, every).charge;
    EXPECT_LT(rms(simulate(model, time, field, {.tolerance = 1e-6, .domains = 8000}).charge, without), 1e-3);
    model.polycrystal.*spread = hardly;
    EXPECT_LT(rms(without, simulate(model, time, field, every).charge), 1e-7);
  }
}

Polycrystal three_spreads() {
  Polycrystal p;
  p.method = PolycrystalMethod::distribution;
  p.barrier_log_std = 0.3;
  p.interaction_field_std = 6e4;
  p.interaction_stress_std = 5e6;
  return p;
}

// Of Tukey's g distribution the mean is (exp(g^2 / 2) - 1) / g, of Student's t with 1 / f degrees of freedom
// the variance 1 / (1 - 2 f).
TEST(Spreads, HaveTheMomentsOfTheirShape) {
  const auto p = three_spreads();
  const auto lattice = make_lattice({}, p, 200000, 0);
  const auto mean = [&](const std::vector<double>& column, int power) {
    double sum = 0;
    for (std::size_t i = 0; i < column.size(); ++i)
      sum += lattice.nodes[i].weight * std::pow(column[i], power);
    return sum;
  };
  const double g = -0.6, f = 0.1;
  const auto skewed = spread_slopes_on(lattice, p, {.skewness = g});
  EXPECT_NEAR(mean(skewed.quantile[0], 1), std::expm1(g * g / 2) / g, 1e-3);
  EXPECT_NEAR(mean(domains_on(lattice, {}, p, {.skewness = g}).field, 2), 6e4 * 6e4, 1e-2 * 6e4 * 6e4);
  const auto heavy = spread_slopes_on(lattice, p, {.inverse_freedom = f});
  for (const auto& column : heavy.quantile) EXPECT_NEAR(mean(column, 2), 1 / (1 - 2 * f), 1e-2);
}

// Closed forms of the quantiles of two and of four degrees of freedom.
TEST(Spreads, HaveTheQuantilesOfStudentsT) {
  Polycrystal p;
  p.method = PolycrystalMethod::distribution;
  p.interaction_field_std = 1;
  for (const double z : {0.3, 1.0, 2.0, 3.0}) {
    const auto at = [&](double f) {
      return domains_on({{{0, z, 0, 1}}}, {}, p, {.inverse_freedom = f}).field.front();
    };
    const double of_two = student_of_two(z), of_four = student_of_four(z);
    EXPECT_NEAR(at(0.5), of_two, (z > 2 ? 0.25 : 0.05) * of_two) << z;
    EXPECT_NEAR(at(0.25), of_four, (z > 2 ? 0.03 : 0.006) * of_four) << z;
    EXPECT_EQ(at(0), z);
  }
}

// By differences, also where the closed form of the skewness gives way to its series.
TEST(Spreads, KnowTheirSlopesByTheShape) {
  const auto p = three_spreads();
  const auto lattice = make_lattice({}, p, 100, 0);
  for (const double g : {-0.8, -1e-5, 0.0, 1e-3, 0.5}) {
    const SpreadShape shape{g, 0.2};
    const double step = 1e-5;
    const auto at = spread_slopes_on(lattice, p, shape);
    const auto right = domains_on(lattice, {}, p, {g + step, 0.2}),
               left = domains_on(lattice, {}, p, {g - step, 0.2}),
               more = domains_on(lattice, {}, p, {g, 0.2 + step}),
               less = domains_on(lattice, {}, p, {g, 0.2 - step});
    for (std::size_t i = 0; i < at.size(); ++i) {
      const double by_g = std::log(right.barrier[i] / left.barrier[i]) / (2 * step),
                   by_f = std::log(more.barrier[i] / less.barrier[i]) / (2 * step);
      EXPECT_NEAR(at.by_skewness[i], by_g, 1e-6 * std::max(1.0, std::abs(by_g)));
      EXPECT_NEAR(at.by_inverse_freedom[0][i], by_f, 1e-6 * std::max(1.0, std::abs(by_f)));
      EXPECT_NEAR(at.by_inverse_freedom[1][i], (more.field[i] - less.field[i]) / (2 * step), 1e-6 * 6e5);
      EXPECT_NEAR(at.by_inverse_freedom[2][i], (more.stress[i] - less.stress[i]) / (2 * step), 1e-6 * 5e7);
    }
  }
}

// F_{a,90} = g_a - g_90, whose derivatives by field and stress are -<P>_a + <P>_90 and -<eps>_a + <eps>_90.
TEST(Wells, AreTheDerivativesOfTheFreeEnergy) {
  Material m;
  m.permittivity_90 = 3e-8;
  m.compliance_90 = 2.3e-11;
  const auto k = kinetic_constants(m);
  for (const double field : {-1.5e6, 0.0, 0.7e6})
    for (const double stress : {-30e6, 0.0, 5e6}) {
      const auto by = [&](double field_step, double stress_step, double step) {
        const auto up = driving_forces(k, {field + field_step, stress + stress_step});
        const auto down = driving_forces(k, {field - field_step, stress - stress_step});
        return std::array{(up.plus_90 - down.plus_90) / (2 * step),
                          (up.minus_90 - down.minus_90) / (2 * step)};
      };
      const auto by_field = by(1e3, 0, 1e3), by_stress = by(0, 1e4, 1e4);
      for (const double sign : {1.0, -1.0}) {
        const std::size_t a = sign > 0 ? 0 : 1;
        const double polarization =
            sign * m.remanent_polarization + m.permittivity_180 * field + sign * m.piezoelectric_180 * stress;
        const double strain = m.compliance_180 * stress + sign * m.piezoelectric_180 * field;
        const double polarization_90 = m.permittivity_90 * field;
        const double strain_90 = m.remanent_strain_90 + m.compliance_90 * stress;
        EXPECT_NEAR(by_field[a], polarization_90 - polarization, 1e-9);
        EXPECT_NEAR(by_stress[a], strain_90 - strain, 1e-11);
      }
    }
}

// Everything that a simulation says, along a program that is played corner by corner.
struct Walk {
  std::vector<double> field, charge, displacement, force, polarization, strain, stress, plus, minus;
};
Walk walk(const Model& model, const Program& p, const SimulationOptions& options = {}) {
  const std::size_t n = p.time.size();
  Walk w;
  for (auto* c : {&w.field, &w.charge, &w.displacement, &w.force, &w.polarization, &w.strain, &w.stress,
                  &w.plus, &w.minus})
    c->resize(n);
  Simulator simulator(model, options);
  simulator.start(p.field[0]);
  for (std::size_t i = 0; i < n; ++i) {
    const auto at = [i](std::vector<double>& c) { return std::span(c).subspan(i, 1); };
    simulator.play(p.time[i] - simulator.time(), p.field[i], std::span(p.time).subspan(i, 1),
                   {.field = at(w.field),
                    .charge = at(w.charge),
                    .displacement = at(w.displacement),
                    .force = at(w.force),
                    .polarization = at(w.polarization),
                    .strain = at(w.strain),
                    .stress = at(w.stress),
                    .fraction_plus = at(w.plus),
                    .fraction_minus = at(w.minus)});
  }
  return w;
}

TEST(Channels, FollowFromTheFractions) {
  const auto model = crystal();
  const auto& m = model.material;
  const auto w = walk(model, loop());
  for (std::size_t i = 0; i < w.field.size(); ++i) {
    const double ninety = 1 - w.plus[i] - w.minus[i], order = w.plus[i] - w.minus[i];
    const double kappa = m.permittivity_180 + (m.permittivity_90 - m.permittivity_180) * ninety;
    const double compliance = m.compliance_180 + (m.compliance_90 - m.compliance_180) * ninety;
    const double polarization =
        order * m.remanent_polarization + kappa * w.field[i] + order * m.piezoelectric_180 * w.stress[i];
    const double strain =
        ninety * m.remanent_strain_90 + compliance * w.stress[i] + order * m.piezoelectric_180 * w.field[i];
    EXPECT_NEAR(w.polarization[i], polarization, 1e-9);
    EXPECT_NEAR(w.strain[i], strain, 1e-11);
    EXPECT_NEAR(w.stress[i],
                -model.load.prestress - model.load.spring_stiffness * w.displacement[i] / model.actuator.area,
                1);
    EXPECT_NEAR(w.force[i], -w.stress[i] * model.actuator.area, 1e-6);
    EXPECT_NEAR(w.charge[i], 100 * model.actuator.area * w.polarization[i], 1e-12);  // 100 layers
  }
}

// But for what a barrier of 27 kT lets through.
TEST(Rest, KeepsThePoledState) {
  auto model = library_model("soft-pzt");
  model.polycrystal = {};
  model.load = {};
  const double time = 1000;
  const auto w = walk(model, {{{0, 0}, {time, 0}}, 10}, {.tolerance = 1e-9});
  const auto& m = model.material;
  const double through =
      time / m.relaxation_time * std::exp(-m.barrier * m.activation_volume / (boltzmann * m.temperature));
  EXPECT_LT(through, 1e-6);
  EXPECT_NEAR(1 - w.plus.back(), through, 0.01 * through);
}

// Wells that exchange within nanoseconds hold what Boltzmann's weights say, and steps are as long as the
// weights' own way asks, some ten times the tolerance, however fast the wells.
TEST(FastWells, StayInEquilibrium) {
  for (const auto law : {BarrierLaw::equal_curvature, BarrierLaw::unequal_curvature}) {
    auto model = library_model("soft-pzt");
    model.polycrystal = {};
    model.load = {};
    auto& m = model.material;
    m.barrier_law = law;
    m.relaxation_time = 1e-9;
    m.barrier = 4 * boltzmann * m.temperature / m.activation_volume;
    const std::array<double, 5> knot_time{0, 0.1, 0.35, 0.6, 0.7}, knot_field{0, 2e5, -2e5, 2e5, 0};
    std::vector<double> time;
    for (int i = 1; i < 140; ++i) time.push_back(0.7 * i / 140);
    std::vector<double> plus(time.size()), minus(time.size()), field(time.size());
    ChannelSpans out;
    out.field = field;
    out.fraction_plus = plus;
    out.fraction_minus = minus;
    const auto took =
        simulate_at(model, knot_time, knot_field, time, out, {.tolerance = 1e-3, .most_steps = 10000});
    EXPECT_LT(took.steps, 2000U);
    const auto k = kinetic_constants(m);
    for (std::size_t i = 0; i < time.size(); ++i) {
      const auto force = driving_forces(k, {field[i], 0});
      const double of_plus = std::exp(-k.inverse_energy * force.plus_90),
                   of_minus = std::exp(-k.inverse_energy * force.minus_90);
      EXPECT_NEAR(plus[i], of_plus / (1 + of_plus + of_minus), 2e-3) << time[i];
      EXPECT_NEAR(minus[i], of_minus / (1 + of_plus + of_minus), 2e-3) << time[i];
    }
  }
}

// Loops of a free specimen whose mean field makes them steep, up to vertical, against tiny steps.
TEST(Steps, KeepToTheToleranceInAMeanField) {
  auto model = library_model("soft-pzt");
  model.load = {};
  model.material.relaxation_time = 1e-3;
  model.material.barrier *= 1.5;
  model.material.remanent_polarization = 0.35;
  const double range = 2 * model.material.remanent_polarization;
  double most = 0, logarithms = 0;
  int count = 0;
  for (const double duration : {1.0, 12.0, 300.0}) {
    const std::array<double, 4> knot_time{0, 0.25 * duration, 0.75 * duration, duration},
        knot_field{0, -2e6, 2e6, 0};
    std::vector<double> time;
    for (int i = 1; i < 500; ++i) time.push_back(duration * i / 500);
    const auto polarization = [&](double tolerance) {
      std::vector<double> out(time.size());
      ChannelSpans spans;
      spans.polarization = out;
      simulate_at(model, knot_time, knot_field, time, spans, {.tolerance = tolerance, .domains = 500});
      return out;
    };
    for (const double coefficient : {5e5, 1e6, 1.5e6, 2e6, 2.5e6, 3e6}) {
      model.effects = {{"mean_field_interaction", {{"coefficient", coefficient}}}};
      const auto exact = polarization(1e-8);
      for (const double tolerance : {1e-3, 3e-4, 1e-4, 1e-5}) {
        const auto found = polarization(tolerance);
        double squares = 0;
        for (std::size_t i = 0; i < exact.size(); ++i) squares += std::pow((found[i] - exact[i]) / range, 2);
        const double error = std::sqrt(squares / static_cast<double>(exact.size())) / tolerance;
        EXPECT_LT(error, 40) << coefficient << " V m/C, " << duration << " s, tolerance " << tolerance;
        most = std::max(most, error);
        logarithms += std::log(error);
        ++count;
      }
    }
  }
  EXPECT_GT(most, 3);  // the loops are hard
  EXPECT_LT(std::exp(logarithms / count), 1.5);
}

TEST(Steps, ConvergeAsTheToleranceFalls) {
  for (const bool poly : {false, true}) {
    auto model = poly ? library_model("soft-pzt") : crystal();
    const auto at = [&](double tolerance) {
      const auto p = loop();
      return simulate(model, p.time, p.field, {.tolerance = tolerance, .domains = 256, .shift = 0});
    };
    const auto exact = at(1e-8);
    double last = 0.02;
    for (const double tolerance : {1e-3, 1e-4, 1e-5, 1e-6}) {
      const auto t = at(tolerance);
      const double error = std::max(apart(exact.charge, t.charge), apart(exact.displacement, t.displacement));
      EXPECT_LT(error, last / 2) << poly << " " << tolerance;
      EXPECT_LT(error, 5 * tolerance) << poly << " " << tolerance;
      last = error;
    }
  }
}

TEST(Program, PlayedPieceByPieceIsThatPlayedWhole) {
  Draw draw(3);
  for (int i = 0; i < 5; ++i) {
    const auto model = draw.model();
    const auto p = draw.program();
    const SimulationOptions options{.tolerance = 1e-5, .domains = 128, .shift = 0};
    const auto whole = simulate(model, p.time, p.field, options);
    const auto pieces = walk(model, p, options);
    EXPECT_LT(apart(whole.charge, pieces.charge), 1e-4) << i;
    EXPECT_LT(apart(whole.displacement, pieces.displacement), 1e-4) << i;
    EXPECT_LT(apart(whole.field, pieces.field), 1e-12) << i;
  }
}

// Work done on the material in the last of several cycles, electrical and mechanical, J/m^3, and what its
// switching turns into heat: - F_{+,90} dx+ - F_{-,90} dx-.
struct Energy {
  double electrical = 0, work = 0, heat = 0;
};
Energy last_cycle(const Model& model) {
  const Program p{{{0, 0}, {0.1, 2e6}, {0.3, -2e6}, {0.5, 2e6}, {0.7, -2e6}, {0.9, 2e6}}, 1e-4};
  const auto w = walk(model, p, {.tolerance = 1e-5, .domains = 256, .shift = 0});
  const auto k = kinetic_constants(model.material);
  Energy e;
  for (std::size_t i = 5001; i < w.field.size(); ++i) {
    const double field = 0.5 * (w.field[i] + w.field[i - 1]), stress = 0.5 * (w.stress[i] + w.stress[i - 1]);
    const auto force = driving_forces(k, {field, stress});
    const double electrical = field * (w.polarization[i] - w.polarization[i - 1]);
    e.electrical += electrical;
    e.work += electrical + stress * (w.strain[i] - w.strain[i - 1]);
    e.heat -= force.plus_90 * (w.plus[i] - w.plus[i - 1]) + force.minus_90 * (w.minus[i] - w.minus[i - 1]);
  }
  return e;
}

// A unit that is told a level every quarter of a millisecond must not lose what creeps meanwhile.
TEST(Hold, MayBePlayedInManyShortPieces) {
  const auto model = library_model("nec-ae0505d08");
  const auto creep_in_pieces_of = [&](double piece) {
    Simulator simulator(model, {.tolerance = 1e-4, .domains = 500});
    simulator.start(0);
    double x = 0;
    const auto go = [&](double duration, double field) {
      const double end = simulator.time() + duration;
      ChannelSpans out;
      out.displacement = std::span(&x, 1);
      simulator.play(duration, field, std::span(&end, 1), out);
      return x;
    };
    go(0.15, 1.5e6);
    const double begin = go(0.2, -5e5);
    for (int i = 0; i < std::lround(10 / piece); ++i) go(piece, -5e5);
    return x - begin;
  };
  const double whole = creep_in_pieces_of(10);
  EXPECT_GT(whole, 2e-6);
  EXPECT_NEAR(creep_in_pieces_of(2.5e-4), whole, 3e-4 * whole);
}

// A unit puts out steps, forty thousand a second.
TEST(Ramp, MayBePlayedInManyShortPieces) {
  const auto model = library_model("soft-pzt");
  const auto charge_in_pieces_of = [&](double piece, double tolerance) {
    Simulator simulator(model, {.tolerance = tolerance, .domains = 200});
    simulator.start(0);
    std::vector<double> out;
    double level = 0;
    for (const auto& [to, rows] : {std::pair(1.5e6, 50), std::pair(-1.5e5, 60), std::pair(7.5e5, 30)}) {
      const auto per_row = std::lround(0.01 / piece);
      for (std::int64_t i = 1; i <= rows * per_row; ++i) {
        const double end = simulator.time() + piece;
        double q = 0;
        ChannelSpans wanted;
        wanted.charge = std::span(&q, 1);
        simulator.play(piece,
                       level + (to - level) * static_cast<double>(i) / static_cast<double>(rows * per_row),
                       std::span(&end, 1), wanted);
        if (i % per_row == 0) out.push_back(q);
      }
      level = to;
    }
    return out;
  };
  const auto fine = charge_in_pieces_of(0.01, 1e-6), cut = charge_in_pieces_of(25e-6, 1e-4);
  const auto [low, high] = std::ranges::minmax(fine);
  double squares = 0;
  for (std::size_t i = 0; i < fine.size(); ++i) squares += (cut[i] - fine[i]) * (cut[i] - fine[i]);
  EXPECT_LT(std::sqrt(squares / static_cast<double>(fine.size())), 1e-4 * (high - low));
}

TEST(Cycle, TurnsItsWorkIntoHeatOfSwitching) {
  for (const double stiffness : {0.0, 2.7e6, 10e6}) {
    auto model = crystal();
    model.load.spring_stiffness = stiffness;
    const auto e = last_cycle(model);
    EXPECT_GT(e.heat, 1e5);
    EXPECT_NEAR(e.work, e.heat, 0.005 * e.heat) << stiffness;
    // Springs give back what they take: the work is the area of the loop of P over E.
    EXPECT_NEAR(e.electrical, e.work, 0.01 * e.heat) << stiffness;
  }
}

TEST(Cycle, TakesWorkWhateverTheModel) {
  Draw draw(8);
  for (int i = 0; i < 8; ++i) EXPECT_GT(last_cycle(draw.model()).electrical, 1e4) << i;
}

TEST(Spring, NoneKeepsTheStressAndAStiffOneKeepsTheLength) {
  auto model = crystal();
  const auto p = unipolar();
  model.load.spring_stiffness = 0;
  const auto free = walk(model, p);
  for (std::size_t i = 0; i < free.stress.size(); ++i) {
    EXPECT_NEAR(free.stress[i], -model.load.prestress, 1e-3);
    EXPECT_NEAR(free.force[i], model.load.prestress * model.actuator.area, 1e-9);
  }
  const double stroke = free.displacement[1000 / 10];
  EXPECT_NEAR(stroke, 2e6 * model.material.piezoelectric_180 * model.actuator.length, 0.05 * stroke);
  model.load.spring_stiffness = 1e12;
  const auto blocked = walk(model, p);
  for (const double x : blocked.displacement) EXPECT_LT(std::abs(x), 2e-4 * stroke);
  // d E = -s sigma while all is +180
  EXPECT_NEAR(blocked.stress[100] + model.load.prestress,
              -2e6 * model.material.piezoelectric_180 / model.material.compliance_180, 1e5);
}

TEST(PassiveLayers, ThatAreVeryStiffAreNone) {
  auto model = crystal();
  const auto none = run(model, loop());
  model.actuator.passive_stiffness = 1e13;
  const auto stiff = run(model, loop());
  EXPECT_LT(apart(none.displacement, stiff.displacement), 1e-5);
  EXPECT_LT(apart(none.charge, stiff.charge), 1e-5);
  model.actuator.passive_stiffness = 1e7;
  EXPECT_GT(apart(none.displacement, run(model, loop()).displacement), 1e-2);
}

}  // namespace
}  // namespace ferrobench::model

// What the source shows of the single crystal in its figures 4.15 to 4.20, as the order of numbers.
#include <gtest/gtest.h>

#include "tests/model/effects_support.h"

namespace ferrobench::model {
namespace {

// The last cycle of a triangle between two fields, both branches by rising field.
struct Branch {
  std::vector<double> field, charge, displacement, plus, minus;
};
struct Cycle {
  Branch up, down;
};

constexpr int samples = 1500;

Branch branch(Simulator& simulator, double to, double rate) {
  Branch b;
  std::vector<double> times;
  const double from = simulator.field(), start = simulator.time(), duration = std::abs(to - from) / rate;
  for (int i = 1; i <= samples; ++i) times.push_back(start + duration * i / samples);
  for (auto* column : {&b.field, &b.charge, &b.displacement, &b.plus, &b.minus}) column->resize(samples);
  ChannelSpans out;
  out.field = b.field;
  out.charge = b.charge;
  out.displacement = b.displacement;
  out.fraction_plus = b.plus;
  out.fraction_minus = b.minus;
  simulator.play(duration, to, times, out);
  if (to < from)
    for (auto* column : {&b.field, &b.charge, &b.displacement, &b.plus, &b.minus})
      std::reverse(column->begin(), column->end());
  return b;
}

Cycle cycle(const Model& model, double low, double high, double rate) {
  Simulator simulator(model);
  simulator.start(0);
  branch(simulator, high, rate);
  branch(simulator, low, rate);
  branch(simulator, high, rate);
  Cycle c;
  c.down = branch(simulator, low, rate);
  c.up = branch(simulator, high, rate);
  return c;
}

double area(const std::vector<double>& up, const std::vector<double>& down) {
  double sum = 0;
  for (std::size_t i = 0; i < up.size(); ++i) sum += std::abs(up[i] - down[i]);
  return sum / static_cast<double>(up.size());
}

// The field at which a column first gets above `level`, by rising field.
double field_at(const Branch& b, const std::vector<double>& column, double level) {
  for (std::size_t i = 0; i < column.size(); ++i)
    if (column[i] > level) return b.field[i];
  return b.field.back();
}

// Share of the branch that is mostly in 90.
double range_of_90(const Branch& b) {
  int in = 0;
  for (std::size_t i = 0; i < b.plus.size(); ++i) in += 1 - b.plus[i] - b.minus[i] > 0.5;
  return (b.field.back() - b.field.front()) * in / static_cast<double>(b.plus.size());
}

double stroke(const Cycle& c) {
  const auto [low, high] = std::minmax_element(c.down.displacement.begin(), c.down.displacement.end());
  return *high - *low;
}

Model single(Load load = {}) {
  auto m = library_model("soft-pzt");
  m.polycrystal = {};
  m.load = load;
  return m;
}

// The source's spring presses wherever the crystal is longer than in 90: relaxed at the length of the 90
// phase. Against the length of the +180 phase that is this prestress.
Load spring_from_90(double stiffness) {
  const auto m = single();
  const double length = m.actuator.length;
  return {.spring_stiffness = stiffness,
          .prestress = stiffness == 0
                           ? 0
                           : -m.material.remanent_strain_90 * length /
                                 (m.actuator.area / stiffness + length * m.material.compliance_180)};
}

TEST(Figure415, FasterLoopsAreWider) {
  double last_field = 0, last_charge = 0, last_strain = 0;
  for (const double rate : {5e4, 5e5, 5e6}) {
    const auto c = cycle(single(), -1.5e6, 1.5e6, rate);
    const double coercive = 0.5 * (field_at(c.up, c.up.charge, 0) - field_at(c.down, c.down.charge, 0));
    const double charge = area(c.up.charge, c.down.charge);
    const double strain = area(c.up.displacement, c.down.displacement);
    std::printf("  rate %.0e coercive %.3e areas %.3e %.3e\n", rate, coercive, charge, strain);
    EXPECT_GT(coercive, 1.02 * last_field);
    EXPECT_GT(charge, 1.02 * last_charge);
    EXPECT_GT(strain, 1.02 * last_strain);
    last_field = coercive;
    last_charge = charge;
    last_strain = strain;
  }
}

TEST(Figure416, StressBringsAndKeeps90) {
  double last_range = -1, last_switch = -1e9;
  for (const double stress : {0.0, 15e6, 30e6, 45e6}) {
    const auto c = cycle(single({.spring_stiffness = 0, .prestress = stress}), -1.5e6, 1.5e6, 5e5);
    const double range = range_of_90(c.down), at = field_at(c.down, c.down.plus, 0.5);
    std::printf("  stress %.0e switches at %.3e range %.3e\n", stress, at, range);
    EXPECT_GT(at, last_switch + 2e4);
    EXPECT_GT(range, last_range + (stress > 0 ? 1e5 : 0));
    last_range = range;
    last_switch = at;
  }
}

TEST(Figure418, SpringMakesTheTransitionSloped) {
  double last = 0;
  for (const double k : {0.0, 3e6, 10e6, 20e6}) {
    const auto c = cycle(single(spring_from_90(k)), -1.5e6, 1.5e6, 5e5);
    double end = c.down.field.back();
    for (std::size_t i = c.down.field.size(); i-- > 0 && c.down.minus[i] < 0.9;) end = c.down.field[i];
    const double slope = field_at(c.down, c.down.plus, 0.9) - end;
    std::printf("  k %.0e transition over %.3e\n", k, slope);
    EXPECT_GT(slope, 1.1 * last);
    last = slope;
  }
}

TEST(Figure419, StifferSpringStabilizes90) {
  double last = -1;
  for (const double k : {0.0, 3e6, 10e6, 20e6}) {
    const auto c = cycle(single(spring_from_90(k)), -1.5e6, 1.5e6, 5e5);
    const double range = range_of_90(c.down);
    std::printf("  k %.0e range of 90 %.3e\n", k, range);
    EXPECT_GT(range, last);
    last = range;
  }
}

// In the actuator's range the unloaded crystal only moves by its piezoelectric effect.
TEST(Figure420, SwitchingInTheActuatorRangeNeedsASpring) {
  const double piezoelectric = 5.5e-10 * 1.9e6 * 0.01;
  const auto at = [](double k) { return cycle(single(spring_from_90(k)), -0.4e6, 1.5e6, 5e6); };
  const auto free = at(0);
  EXPECT_GT(free.down.plus.front(), 0.99);
  EXPECT_NEAR(stroke(free), piezoelectric, 0.05 * piezoelectric);
  double last = stroke(free);
  for (const double k : {3e6, 10e6, 20e6}) {
    const auto c = at(k);
    std::printf("  k %.0e stroke %.3e against %.3e lowest x+ %.3f\n", k, stroke(c), piezoelectric,
                c.down.plus.front());
    EXPECT_GT(stroke(c), last);
    last = stroke(c);
  }
  EXPECT_GT(last, 1.5 * piezoelectric);
}

}  // namespace
}  // namespace ferrobench::model

// The kernel's instruction sets against each other, and against the plain formulas of wells.h and barrier.h.
#include "model/physics/kernel.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numeric>
#include <random>
#include <string>
#include <vector>

#include "model/physics/barrier.h"
#include "model/physics/domains.h"
#include "tests/bench/kernel_bench.h"

namespace ferrobench::model {
namespace {

struct Case {
  std::string name;
  BarrierLaw law;
  double stress_stabilization = 0;  // 1/Pa
  double asymmetry = 0, direct_rate = 0;
};

class Kernel : public testing::TestWithParam<Case> {
 protected:
  void TearDown() override { force_kernel_target(""); }

  static KineticConstants constants() {
    Material material;
    material.permittivity_90 = 3e-8;
    material.compliance_90 = 2e-11;
    material.barrier_law = GetParam().law;
    auto k = kinetic_constants(material);
    k.stress_stabilization = GetParam().stress_stabilization;
    k.barrier_asymmetry = GetParam().asymmetry;
    k.direct_rate = GetParam().direct_rate;
    k.direct_barrier = 1.3;
    return k;
  }
  static Domains domains() {
    Polycrystal p;
    p.method = PolycrystalMethod::distribution;
    p.barrier_log_std = 0.35;
    p.interaction_field_std = 8e4;
    p.interaction_stress_std = 4e6;
    return make_domains({}, p, 300, 0);
  }
};

double rms_difference(const std::vector<double>& a, const std::vector<double>& b, std::size_t count) {
  double sum = 0;
  for (std::size_t i = 0; i < count; ++i) sum += (a[i] - b[i]) * (a[i] - b[i]);
  return std::sqrt(sum / static_cast<double>(count));
}

// Of + -> 90, 90 -> +, 90 -> -, - -> 90, + -> -, - -> +.
using Six = std::array<double, 6>;

// ln(tau r).
Six plain_log_rates(const KineticConstants& k, const Domains& d, std::size_t i, const Loads& at) {
  const Loads seen{at.field + d.field[i], at.stress + d.stress[i]};
  const auto force = driving_forces(k, seen);
  const double out = d.barrier[i];
  const double back = out * (1 + k.stress_stabilization * std::max(0.0, -seen.stress));
  const auto barrier = [&](double f, double dg0, bool from_90) {
    if (k.law == BarrierLaw::equal_curvature) return barrier_equal_curvature(from_90 ? -f : f, dg0);
    return barrier_unequal_curvature(f, dg0, k.polarization, 2 * k.half_permittivity, 0, from_90);
  };
  const double up = std::exp(k.barrier_asymmetry), down = 1 / up;
  const double between = force.plus_90 - force.minus_90, direct = out * k.direct_barrier;
  const double log_rate = std::log(k.direct_rate);
  return {-k.inverse_energy * barrier(force.plus_90, out * down, false),
          -k.inverse_energy * barrier(force.plus_90, back * up, true),
          -k.inverse_energy * barrier(force.minus_90, back * down, true),
          -k.inverse_energy * barrier(force.minus_90, out * up, false),
          log_rate - k.inverse_energy * barrier_equal_curvature(between, direct * down),
          log_rate - k.inverse_energy * barrier_equal_curvature(-between, direct * up)};
}

// Mean of exp(l0 + (l1 - l0) u) (1 + q u (1 - u)) over u in [0, 1] by Simpson's rule.
double plain_mean_rate(double l0, double l1, double q) {
  constexpr int n = 4000;
  double sum = 0;
  for (int i = 0; i <= n; ++i) {
    const double u = static_cast<double>(i) / n;
    const double weight = i == 0 || i == n ? 1 : 2 + 2 * (i % 2);
    sum += weight * std::exp(l0 + (l1 - l0) * u) * (1 + q * u * (1 - u));
  }
  return sum / (3 * n);
}

// x' = A x + b over unit time: Taylor series of a small part of it, squared up.
std::array<double, 2> plain_exponential(const Six& a, double plus, double minus) {
  std::array<long double, 2> x{plus, minus};
  const int parts = 64 + static_cast<int>(8 * std::accumulate(a.begin(), a.end(), 0.0));
  for (int part = 0; part < parts; ++part) {
    std::array<long double, 2> term = x;
    for (int order = 1; order < 20; ++order) {
      const long double ninety = (order == 1 ? 1.0L : 0.0L) - term[0] - term[1];
      const long double h = 1.0L / parts / order;
      const long double turned = a[4] * term[0] - a[5] * term[1];
      term = {h * (a[1] * ninety - a[0] * term[0] - turned), h * (a[2] * ninety - a[3] * term[1] + turned)};
      x[0] += term[0];
      x[1] += term[1];
    }
  }
  return {static_cast<double>(x[0]), static_cast<double>(x[1])};
}

// What a step's change may be off, relative to itself: along an eigenvector, and where both meet.
constexpr double eigenvector_error = 3.1e-8, propagation_error = 1.9e-7;

const LoadPath path{{-4e5, -8e6}, {-4.3e5, -9e6}, {0, 0}};

TEST_P(Kernel, EveryInstructionSetGivesTheSame) {
  const double bound = GetParam().asymmetry != 0 ? 1e-11 : 1e-12;
  const auto targets = kernel_targets();
  ASSERT_GE(targets.size(), 2U);
  const LoadPath bent{path.from, path.to, {1e3, 2e4}};
  force_kernel_target(targets.front());
  bench::KernelBench best(domains(), constants());
  best.start(path.from);
  const auto expected = best.step(0.02, bent);
  for (const auto& target : targets) {
    SCOPED_TRACE(target);
    force_kernel_target(target);
    ASSERT_EQ(kernel_targets().front(), target);
    bench::KernelBench other(domains(), constants());
    other.start(path.from);
    const auto result = other.step(0.02, bent);
    for (const auto columns : {&bench::KernelBench::Rates::log_rate, &bench::KernelBench::Rates::rate})
      for (std::size_t j = 0; j < most_transitions; ++j)
        for (std::size_t i = 0; i < best.size(); ++i) {
          const double value = (best.after().*columns).at(j)[i];
          ASSERT_NEAR((other.after().*columns).at(j)[i], value, 1e-12 * std::max(1.0, std::abs(value)));
        }
    EXPECT_LT(rms_difference(other.plus(), best.plus(), best.size()), bound);
    EXPECT_LT(rms_difference(other.minus(), best.minus(), best.size()), bound);
    EXPECT_NEAR(result.plus, expected.plus, bound);
    EXPECT_NEAR(result.minus, expected.minus, bound);
  }
}

TEST_P(Kernel, RatesAreThoseOfThePlainFormulas) {
  const auto d = domains();
  for (const auto& target : kernel_targets()) {
    SCOPED_TRACE(target);
    force_kernel_target("");
    force_kernel_target(target);
    for (const double field : {1.5e6, 3e5, 0.0, -4e5, -5.5e5, -1.5e6}) {
      const Loads at{field, -8e6};
      bench::KernelBench kernel(d, constants());
      kernel.start(at);
      for (std::size_t i = 0; i < d.size(); ++i) {
        const auto expected = plain_log_rates(constants(), d, i, at);
        for (std::size_t j = 0; j < transition_count(constants()); ++j) {
          const double rate = std::exp(expected.at(j));
          ASSERT_NEAR(kernel.before().log_rate.at(j)[i], expected.at(j),
                      1e-12 * std::max(1.0, std::abs(expected.at(j))))
              << "rate " << j << " of domain " << i << " at " << field << " V/m";
          ASSERT_NEAR(kernel.before().rate.at(j)[i], rate, 1e-12 * std::max(1.0, rate));
        }
      }
    }
  }
}

TEST_P(Kernel, FractionsFollowTheTwoStateSystem) {
  const auto d = domains();
  const auto k = constants();
  bench::KernelBench kernel(d, k);
  kernel.start(path.from);
  constexpr double h = 0.02;
  kernel.hold(h);
  for (std::size_t i = 0; i < d.size(); i += 7) {
    auto a = plain_log_rates(k, d, i, path.from);
    for (auto& v : a) v = h / k.relaxation_time * std::exp(v);  // exp(-inf) where nothing is direct
    const auto expected = plain_exponential(a, 0.5, 0.2);
    ASSERT_NEAR(kernel.plus()[i], expected[0], propagation_error);
    ASSERT_NEAR(kernel.minus()[i], expected[1], propagation_error);
  }
  // In a step with moving loads each intensity is that of the bent logarithm. The unequal law bends by the
  // equal law's curvature, and barriers that differ from dg0 by dg0's, so they are compared where nothing
  // bends.
  if (k.law != BarrierLaw::equal_curvature || k.stress_stabilization != 0 || k.barrier_asymmetry != 0) return;
  kernel.step(h, path);
  for (std::size_t i = 0; i < d.size(); i += 7) {
    const auto l0 = plain_log_rates(k, d, i, path.from), l1 = plain_log_rates(k, d, i, path.to);
    const auto f0 = driving_forces(k, {path.from.field + d.field[i], path.from.stress + d.stress[i]});
    const auto f1 = driving_forces(k, {path.to.field + d.field[i], path.to.stress + d.stress[i]});
    const auto bend = [&](double from, double to, double dg0) {
      const bool inside = std::max(std::abs(from), std::abs(to)) < 4 * dg0;
      return inside ? k.inverse_energy * (to - from) * (to - from) / (16 * dg0) : 0;
    };
    const double plus = bend(f0.plus_90, f1.plus_90, d.barrier[i]),
                 minus = bend(f0.minus_90, f1.minus_90, d.barrier[i]),
                 between = bend(f0.plus_90 - f0.minus_90, f1.plus_90 - f1.minus_90,
                                k.direct_barrier * d.barrier[i]);
    const Six q{plus, plus, minus, minus, between, between};
    Six a{};
    for (std::size_t j = 0; j < transition_count(k); ++j)
      a.at(j) = h / k.relaxation_time * plain_mean_rate(l0.at(j), l1.at(j), q.at(j));
    const auto expected = plain_exponential(a, 0.5, 0.2);
    ASSERT_NEAR(kernel.plus()[i], expected[0], propagation_error);
    ASSERT_NEAR(kernel.minus()[i], expected[1], propagation_error);
  }
}

class KernelPropagation : public testing::Test {
 protected:
  void TearDown() override { force_kernel_target(""); }
};

// One held step of domains with any rates from any fractions, h = tau = 1.
struct Held {
  bool direct = false;
  std::array<std::vector<double>, most_transitions> rate, log_rate;
  std::vector<double> plus, minus, next_plus, next_minus, falling, rising, unused;

  void add(const Six& rates, double x_plus, double x_minus) {
    for (std::size_t j = 0; j < rates.size(); ++j) rate.at(j).push_back(rates.at(j));
    plus.push_back(x_plus);
    minus.push_back(x_minus);
  }
  void step() {
    const std::size_t count = plus.size(), padded = count + DomainColumns::padding;
    for (auto& v : rate) v.resize(padded);
    for (auto* v : {&plus, &minus}) v->resize(padded);
    for (auto* v : {&next_plus, &next_minus, &falling, &rising, &unused}) v->assign(padded, 0);
    log_rate.fill(unused);
    RateColumns columns;
    for (std::size_t j = 0; j < most_transitions; ++j) {
      columns.log_rate.at(j) = log_rate.at(j).data();
      columns.rate.at(j) = rate.at(j).data();
    }
    const double* none = unused.data();
    KineticConstants constants;
    constants.direct_rate = direct ? 1 : 0;
    step_domains_held(constants, {none, none, none, none, none, plus.data(), minus.data()}, count, 1, columns,
                      {next_plus.data(), next_minus.data(), falling.data(), rising.data(), 0});
  }
};

// What x+ and x- change by in unit time, in closed form without differences of nearly equal numbers unless
// both eigenvalues nearly meet.
std::array<long double, 2> exact_change(const std::array<double, 4>& q, long double plus, long double minus) {
  const long double a = q[0], b = q[1], c = q[2], e = q[3];
  const long double ninety = 1 - plus - minus, determinant = a * (c + e) + b * e;
  const long double half = (a + b - c - e) / 2, root = std::sqrt(half * half + b * c);
  const long double fast = (a + b + c + e) / 2 + root, slow = determinant / fast;
  const auto psi = [](long double y) { return y == 0 ? 1 : -std::expm1(-y) / y; };
  const long double by_flow = -std::exp(-slow) * std::expm1(-2 * root) / (2 * root);
  const long double by_adjoint = (psi(slow) - psi(fast)) / (2 * root);
  return {by_flow * (b * ninety - a * plus) + by_adjoint * (b * e - plus * determinant),
          by_flow * (c * ninety - e * minus) + by_adjoint * (a * c - minus * determinant)};
}

// Rates from one to the other, 3 % apart.
std::vector<double> decades(double from, double to) {
  std::vector<double> out{from};
  while (out.back() * 1.03 < to) out.push_back(out.back() * 1.03);
  return out;
}

// What is left of a fast pair's way to equilibrium must not look like a flow when its rate multiplies it.
TEST_F(KernelPropagation, LeavesNoFlowBehindAFastPair) {
  Held held;
  for (const double a : decades(1e3, 1e12)) held.add({a, 0.7 * a, 0, 0}, 1, 0);
  const std::size_t count = held.plus.size();
  held.step();
  for (std::size_t i = 0; i < count; ++i) {
    const double a = held.rate[0][i];
    const double flow = 0.7 * a * (1 - held.next_plus[i] - held.next_minus[i]) - a * held.next_plus[i];
    EXPECT_LT(std::abs(flow), 1e-4 + 2e-15 * a) << a;
  }
}

TEST_F(KernelPropagation, IsExactToItsErrorAlongAnEigenvector) {
  // With one transition alone, a of what is in x+ leaves as 1 - exp(-a).
  Held held;
  for (const double a : decades(1e-12, 1e16)) held.add({a, 0, 0, 0}, 1, 0);
  const std::size_t count = held.plus.size();
  held.step();
  double largest = 0;
  for (std::size_t i = 0; i < count; ++i) {
    const double change = std::expm1(-held.rate[0][i]);
    // 4e-16: x+ itself is rounded
    largest = std::max(largest, (std::abs(held.next_plus[i] - 1 - change) - 4e-16) / std::abs(change));
    ASSERT_GE(held.next_plus[i], 0);
    ASSERT_EQ(held.next_minus[i], 0);
  }
  EXPECT_LT(largest, eigenvector_error);
  EXPECT_GT(largest, 0.9 * eigenvector_error);  // what the header promises is no more than it keeps
}

TEST_F(KernelPropagation, IsExactToItsErrorOverManyDecades) {
  std::mt19937_64 random(7);
  std::uniform_real_distribution<double> decade(-14, 14), part(0, 1);
  Held held;
  constexpr std::size_t count = 40000;
  for (std::size_t i = 0; i < count; ++i) {
    Six rates{};
    for (std::size_t j = 0; j < 4; ++j) rates.at(j) = std::pow(10, decade(random));
    const double plus = i % 4 == 0 ? 1 : part(random);
    if (i % 8 > 4)
      rates[2] = rates[0] * (1 + 1e-3 * part(random));  // + -> 90 -> - with eigenvalues that meet
    const double minus = i % 4 == 0 ? 0 : (i % 4 == 1 ? 1 : part(random)) * (1 - plus);
    held.add(rates, plus, minus);
  }
  for (const auto& target : kernel_targets()) {
    SCOPED_TRACE(target);
    force_kernel_target("");
    force_kernel_target(target);
    auto run = held;
    run.step();
    for (std::size_t i = 0; i < count; ++i) {
      const std::array<double, 4> q{run.rate[0][i], run.rate[1][i], run.rate[2][i], run.rate[3][i]};
      const auto change = exact_change(q, run.plus[i], run.minus[i]);
      const auto flows = static_cast<double>(
          std::max({std::abs(change[0]), std::abs(change[1]), std::abs(change[0] + change[1])}));
      const double allowed = propagation_error * flows + 1e-15;
      const auto of = [&](double x, long double by) { return static_cast<double>(x + by); };
      ASSERT_NEAR(run.next_plus[i], of(run.plus[i], change[0]), allowed) << i;
      ASSERT_NEAR(run.next_minus[i], of(run.minus[i], change[1]), allowed) << i;
      ASSERT_GE(run.next_plus[i], 0);
      ASSERT_GE(run.next_minus[i], 0);
      ASSERT_GE(1 - run.next_plus[i] - run.next_minus[i], 0);
    }
  }
}

TEST_F(KernelPropagation, WhereEigenvaluesMeetOrVanish) {
  const std::vector<Six> cases{{0, 0, 0, 0}, {1, 0, 0, 1},          {3, 1e-9, 1e-9, 3}, {0, 2, 2, 0},
                               {5, 0, 0, 0}, {0, 0, 4, 0},          {2, 1e-6, 1, 3},    {1e-3, 0, 0, 1e-3},
                               {0, 1, 0, 0}, {1e-200, 0, 0, 1e-200}};
  Held held;
  for (const auto& q : cases) held.add(q, 0.5, 0.2);
  held.step();
  for (std::size_t i = 0; i < cases.size(); ++i) {
    const auto expected = plain_exponential(cases[i], 0.5, 0.2);
    EXPECT_NEAR(held.next_plus[i], expected[0], propagation_error) << i;
    EXPECT_NEAR(held.next_minus[i], expected[1], propagation_error) << i;
  }
  EXPECT_EQ(held.next_plus[0], 0.5);  // nothing flows, nothing changes
  EXPECT_EQ(held.next_minus[0], 0.2);
  // A number that is none stays so, not a fraction that looks well.
  Held bad;
  bad.add({std::numeric_limits<double>::quiet_NaN(), 1, 1, 1}, 0.5, 0.2);
  bad.step();
  EXPECT_TRUE(std::isnan(bad.next_plus[0]));
  EXPECT_TRUE(std::isnan(bad.next_minus[0]));
}

TEST_F(KernelPropagation, OfDirectSwitching) {
  std::mt19937_64 random(11);
  std::uniform_real_distribution<double> decade(-6, 2), part(0, 1);
  Held held;
  held.direct = true;
  for (int i = 0; i < 400; ++i) {
    // Rates of a chain that keeps the detailed balance, as the barriers do: its eigenvalues are real.
    const double a = std::pow(10, decade(random)), b = std::pow(10, decade(random)),
                 c = std::pow(10, decade(random)), e = std::pow(10, decade(random)),
                 p = std::pow(10, decade(random)), m = p * b * e / (a * c);
    if (m > 1e2) continue;
    const double plus = part(random);
    held.add({a, b, c, e, p, m}, plus, (1 - plus) * part(random));
  }
  const std::size_t count = held.plus.size();
  ASSERT_GT(count, 150U);
  held.step();
  for (std::size_t i = 0; i < count; ++i) {
    const Six q{held.rate[0][i], held.rate[1][i], held.rate[2][i],
                held.rate[3][i], held.rate[4][i], held.rate[5][i]};
    const auto expected = plain_exponential(q, held.plus[i], held.minus[i]);
    EXPECT_NEAR(held.next_plus[i], expected[0], propagation_error) << i;
    EXPECT_NEAR(held.next_minus[i], expected[1], propagation_error) << i;
  }
}

INSTANTIATE_TEST_SUITE_P(Laws, Kernel,
                         testing::Values(Case{"equal", BarrierLaw::equal_curvature},
                                         Case{"unequal", BarrierLaw::unequal_curvature},
                                         Case{"equal_stabilized", BarrierLaw::equal_curvature, 2e-8},
                                         Case{"unequal_stabilized", BarrierLaw::unequal_curvature, 2e-8},
                                         Case{"equal_direct", BarrierLaw::equal_curvature, 0, 0, 0.3},
                                         Case{"unequal_stabilized_asymmetric_direct",
                                              BarrierLaw::unequal_curvature, 2e-8, 0.1, 0.3},
                                         Case{"equal_stabilized_asymmetric_direct",
                                              BarrierLaw::equal_curvature, 2e-8, -0.1, 3}),
                         [](const auto& instance) { return instance.param.name; });

}  // namespace
}  // namespace ferrobench::model

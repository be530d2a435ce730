#include "tests/campaign/nodes.h"

#include <array>
#include <boost/math/distributions/normal.hpp>
#include <boost/math/distributions/students_t.hpp>
#include <boost/random/sobol.hpp>
#include <cmath>
#include <numbers>
#include <random>

namespace ferrobench::campaign {
namespace {

double quantile(double inverse_freedom, double u) {
  if (inverse_freedom > 0) return boost::math::quantile(boost::math::students_t(1 / inverse_freedom), u);
  return boost::math::quantile(boost::math::normal(), u);
}

// One-sided stable with <exp(-s k)> = exp(-s^beta), from two even numbers in 0..1 (Kanter 1975): rates k
// spread like this, each waiting exponentially, together wait as the stretched exponential.
double stable(double beta, double u, double v) {
  const double angle = std::numbers::pi * u, wait = -std::log(v);
  return std::sin(beta * angle) * std::pow(std::sin(angle), -1 / beta) *
         std::pow(std::sin((1 - beta) * angle) / wait, (1 - beta) / beta);
}

}  // namespace

Nodes draw_nodes(const model::Material& m, const model::Polycrystal& p, int count, const Terms& terms) {
  const bool distributed = p.method == model::PolycrystalMethod::distribution;
  const double bias = distributed ? p.bias_field : 0;
  const std::array<double, 3> spread{distributed ? p.barrier_log_std : 0,
                                     distributed ? p.interaction_field_std : 0,
                                     distributed ? p.interaction_stress_std : 0};
  const bool stretched = terms.stretching < 1;
  int dimensions = stretched ? 2 : 0;
  for (const double s : spread) dimensions += s != 0;
  if (dimensions == 0) return {{m.barrier}, {bias}, {0}, {1}, {}};
  // A digital shift keeps what makes the sequence even and leaves out its first point, the corner.
  boost::random::sobol sequence(static_cast<std::size_t>(dimensions));
  std::mt19937_64 random(1);
  std::array<std::uint64_t, 5> shift{random(), random(), random(), random(), random()};
  const auto even = [&](std::size_t k) {
    return std::ldexp(static_cast<double>((sequence() ^ shift.at(k)) >> 11) + 0.5, -53);
  };
  Nodes out;
  for (int i = 0; i < count; ++i) {
    std::array<double, 3> z{};
    for (std::size_t k = 0; k < 3; ++k)
      if (spread.at(k) != 0) z.at(k) = quantile(terms.inverse_freedom, even(k));
    if (stretched) {
      const double u = even(3), v = even(4);
      out.pace.push_back(stable(terms.stretching, u, v));
    }
    out.barrier.push_back(m.barrier * std::exp(spread[0] * z[0]));
    out.field.push_back(bias + spread[1] * z[1]);
    out.stress.push_back(spread[2] * z[2]);
    out.weight.push_back(1.0 / count);
  }
  return out;
}

}  // namespace ferrobench::campaign

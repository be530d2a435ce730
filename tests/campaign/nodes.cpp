#include "tests/campaign/nodes.h"

#include <array>
#include <boost/math/distributions/normal.hpp>
#include <boost/random/sobol.hpp>
#include <cmath>
#include <random>

namespace ferrobench::campaign {
Nodes draw_nodes(const model::Material& m, const model::Polycrystal& p, int count) {
  const bool distributed = p.method == model::PolycrystalMethod::distribution;
  const double bias = distributed ? p.bias_field : 0;
  const std::array<double, 3> spread{distributed ? p.barrier_log_std : 0,
                                     distributed ? p.interaction_field_std : 0,
                                     distributed ? p.interaction_stress_std : 0};
  int dimensions = 0;
  for (const double s : spread) dimensions += s != 0;
  if (dimensions == 0) return {{m.barrier}, {bias}, {0}, {1}};
  // A digital shift keeps what makes the sequence even and leaves out its first point, the corner.
  boost::random::sobol sequence(static_cast<std::size_t>(dimensions));
  std::mt19937_64 random(1);
  std::array<std::uint64_t, 3> shift{random(), random(), random()};
  const boost::math::normal normal;
  Nodes out;
  for (int i = 0; i < count; ++i) {
    std::array<double, 3> z{};
    for (std::size_t k = 0; k < 3; ++k)
      if (spread.at(k) != 0)
        z.at(k) =
            quantile(normal, std::ldexp(static_cast<double>((sequence() ^ shift.at(k)) >> 11) + 0.5, -53));
    out.barrier.push_back(m.barrier * std::exp(spread[0] * z[0]));
    out.field.push_back(bias + spread[1] * z[1]);
    out.stress.push_back(spread[2] * z[2]);
    out.weight.push_back(1.0 / count);
  }
  return out;
}

}  // namespace ferrobench::campaign

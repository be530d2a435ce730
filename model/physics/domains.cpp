#include "model/physics/domains.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include "model/physics/wells.h"

namespace ferrobench::model {
namespace {

using Vector = Eigen::Vector3d;

// Cell edges of the centred lattice, for `count` nodes in the ball. Domains switch at a driving force to
// which the three spreads contribute in proportion to `reach`, so what is integrated is nearly a step across
// planes with that normal. The edges are chosen so that the normal always lies the same way in the lattice,
// along a direction in which the nodes' projections fall evenly; an edge stays short enough for the Gaussian
// weight itself.
Vector cell_edges(const Vector& reach, int dimensions, double volume_per_node) {
  const Vector direction(0.93, 0.32, 0.16);
  constexpr double longest = 2.0;
  const double points_per_cell = dimensions == 1 ? 1 : 2;
  Vector edges = Vector::Ones();
  std::array<bool, 3> fixed{false, false, false};
  for (int round = 0; round < dimensions; ++round) {
    double product = points_per_cell * volume_per_node, shape = 1;
    int open = 0;
    for (int i = 0; i < dimensions; ++i) {
      if (fixed.at(static_cast<std::size_t>(i))) {
        product /= edges[i];
      } else {
        shape *= direction[i] / reach[i];
        ++open;
      }
    }
    if (open == 0) break;
    const double scale = std::pow(product / shape, 1.0 / open);
    bool again = false;
    for (int i = 0; i < dimensions; ++i) {
      if (fixed.at(static_cast<std::size_t>(i))) continue;
      edges[i] = scale * direction[i] / reach[i];
      if (edges[i] > longest && open > 1) {
        edges[i] = longest;
        fixed.at(static_cast<std::size_t>(i)) = true;
        again = true;
      }
    }
    if (!again) break;
  }
  return edges;
}

// Beyond this the Gaussian's tails weigh less than the nodes' own error.
double radius_for(int dimensions, int count) {
  const double per_axis = std::pow(count, 1.0 / dimensions);
  if (per_axis < 7.4) return 3.5;
  return per_axis < 9.3 ? 4.0 : 4.5;
}

double ball_volume(int dimensions, double radius) {
  constexpr double pi = 3.14159265358979323846;
  if (dimensions == 1) return 2 * radius;
  if (dimensions == 2) return pi * radius * radius;
  return 4.0 / 3.0 * pi * radius * radius * radius;
}

// Barriers e^50 times the middle one are never crossed and those of e^-50 times it are none; nothing
// overflows on the way.
constexpr double farthest_barrier = 50;

struct WithSlope {
  double value = 0, slope = 0;
};
// (exp(g z) - 1) / g, and its slope by g.
WithSlope skewed_score(double z, double g) {
  const double gz = g * z;
  // The closed slope is a difference of numbers near each other; the series is 1e-12 off there.
  if (std::abs(gz) < 1e-4) return {z * (1 + gz / 2 + gz * gz / 6), z * z * (0.5 + gz / 3 + gz * gz / 8)};
  return {std::expm1(gz) / g, (gz * std::exp(gz) - std::expm1(gz)) / (g * g)};
}
// Student's t over the normal score, and its slope by the inverse degrees of freedom f.
WithSlope tail_factor(double z, double f) {
  const double c = (8 + 3 * f) / (8 + f), c_slope = 16 / ((8 + f) * (8 + f));
  // Beyond this a domain's field or barrier is out of reach, and nothing may overflow.
  const double u = std::min(c * c * f * z * z, 100.0), u_slope = c * z * z * (c + 2 * c_slope * f);
  // (exp(u) - 1) / u and its slope by u
  const double growth = u < 1e-4 ? 1 + u / 2 + u * u / 6 : std::expm1(u) / u;
  const double growth_slope = u < 1e-4 ? 0.5 + u / 3 + u * u / 8 : (std::exp(u) - growth) / u;
  const double value = c * std::sqrt(growth);
  return {value, c_slope * std::sqrt(growth) + 0.5 * c * growth_slope * u_slope / std::sqrt(growth)};
}

struct Quantiles {
  std::array<double, 3> q{}, by_inverse_freedom{};
  double by_skewness = 0;  // of the first
};
Quantiles quantiles_at(const Lattice::Node& node, const SpreadShape& shape) {
  const std::array z{node.z1, node.z2, node.z3};
  Quantiles out;
  for (std::size_t i = 0; i < z.size(); ++i) {
    const auto tail = tail_factor(z.at(i), shape.inverse_freedom);
    const auto score = i == 0 ? skewed_score(z.at(i), shape.skewness) : WithSlope{z.at(i), 0};
    out.q.at(i) = tail.value * score.value;
    out.by_inverse_freedom.at(i) = tail.slope * score.value;
    if (i == 0) out.by_skewness = tail.value * score.slope;
  }
  return out;
}

}  // namespace

int spread_dimensions(const Polycrystal& p) {
  return static_cast<int>(p.barrier_log_std != 0) + static_cast<int>(p.interaction_field_std != 0) +
         static_cast<int>(p.interaction_stress_std != 0);
}

int domains_for(const Material& m, const Polycrystal& p, double tolerance) {
  if (p.method != PolycrystalMethod::distribution) return 1;
  tolerance = std::clamp(tolerance, 1e-7, 1e-2);
  const double spread =
      std::hypot(p.barrier_log_std * 4 * m.barrier, p.interaction_field_std * m.remanent_polarization,
                 p.interaction_stress_std * m.remanent_strain_90);
  // The counts below were found at a spread of about 40 kT.
  const double sharpness = spread * m.activation_volume / (boltzmann * m.temperature) / 40;
  const double more = std::clamp(std::pow(sharpness, 1.5), 1.0, 8.0);
  switch (spread_dimensions(p)) {
    case 0:
      return 1;
    case 1:
      return static_cast<int>(more * 64 * std::pow(1e-3 / tolerance, 0.5));
    case 2:
      return static_cast<int>(more * 192 * std::pow(1e-3 / tolerance, 0.5));
    default:
      return static_cast<int>(more * 256 * std::pow(1e-3 / tolerance, 0.6));
  }
}

Lattice make_lattice(const Material& material, const Polycrystal& p, int count, std::uint64_t shift,
                     bool every_spread) {
  const int spreads = p.method == PolycrystalMethod::distribution ? spread_dimensions(p) : 0;
  const int dimensions = every_spread && spreads > 0 ? 3 : spreads;
  std::vector<Vector> nodes;
  if (dimensions == 0 || count <= 1) {
    nodes.emplace_back(Vector::Zero());
  } else {
    const double radius = radius_for(dimensions, count);
    Vector reach = Vector::Zero();
    int next = 0;
    for (const double contribution :
         {p.barrier_log_std * 4 * material.barrier, p.interaction_field_std * material.remanent_polarization,
          p.interaction_stress_std * std::abs(material.remanent_strain_90)})
      if (contribution != 0 || dimensions == 3) reach[next++] = contribution;
    reach = reach.cwiseMax(1e-6 * reach.maxCoeff());
    const Vector edges = cell_edges(reach, dimensions, ball_volume(dimensions, radius) / count);
    // Shifts by multiples of the golden ratio's higher-dimensional kin are spread evenly over the cell.
    Vector offset = Vector::Zero();
    const std::array<double, 3> step{0.8191725133961645, 0.6710436067037893, 0.5497004779019703};
    std::array<int, 3> last{0, 0, 0};
    for (int i = 0; i < dimensions; ++i) {
      const auto axis = static_cast<std::size_t>(i);
      offset[i] = std::fmod(0.5 + step.at(axis) * static_cast<double>(shift % 1000003), 1.0);
      last.at(axis) = static_cast<int>(std::ceil(radius / edges[i])) + 1;
    }
    const int centred = dimensions > 1 ? 2 : 1;
    for (int i = -last[0]; i <= last[0]; ++i)
      for (int j = -last[1]; j <= last[1]; ++j)
        for (int k = -last[2]; k <= last[2]; ++k)
          for (int c = 0; c < centred; ++c) {
            Vector z = Vector(i, j, k) + offset;
            z.head(dimensions).array() += 0.5 * c;
            z = z.cwiseProduct(edges);
            z.tail(3 - dimensions).setZero();
            if (z.squaredNorm() <= radius * radius) nodes.push_back(z);
          }
  }

  Lattice out;
  double total = 0;
  std::map<std::array<double, 3>, std::size_t> same;  // only where a spread of the lattice is zero
  for (const auto& z : nodes) {
    int next = 0;
    const auto coordinate = [&](double std) {
      const double at = (std != 0 || dimensions == 3) && dimensions > 0 ? z[next++] : 0.0;
      return std != 0 ? at : 0.0;
    };
    const double z1 = coordinate(p.barrier_log_std), z2 = coordinate(p.interaction_field_std),
                 z3 = coordinate(p.interaction_stress_std);
    const double weight = std::exp(-0.5 * (z[0] * z[0] + z[1] * z[1] + z[2] * z[2]));
    total += weight;
    if (dimensions > spreads) {
      const auto [known, is_new] = same.try_emplace({z1, z2, z3}, out.nodes.size());
      if (!is_new) {
        out.nodes[known->second].weight += weight;
        continue;
      }
    }
    out.nodes.push_back({z1, z2, z3, weight});
  }
  for (auto& node : out.nodes) node.weight /= total;
  return out;
}

Domains domains_on(const Lattice& lattice, const Material& material, const Polycrystal& p,
                   const SpreadShape& shape) {
  Domains out;
  for (const auto& node : lattice.nodes) {
    const auto q = quantiles_at(node, shape).q;
    const double log_ratio = std::clamp(p.barrier_log_std * q[0], -farthest_barrier, farthest_barrier);
    out.barrier.push_back(material.barrier * std::exp(log_ratio));
    out.field.push_back(p.bias_field + p.interaction_field_std * q[1]);
    out.stress.push_back(p.interaction_stress_std * q[2]);
    out.weight.push_back(node.weight);
  }
  return out;
}

SpreadSlopes spread_slopes_on(const Lattice& lattice, const Polycrystal& p, const SpreadShape& shape) {
  const std::array std{p.barrier_log_std, p.interaction_field_std, p.interaction_stress_std};
  SpreadSlopes out;
  for (const auto& node : lattice.nodes) {
    const auto at = quantiles_at(node, shape);
    for (std::size_t i = 0; i < std.size(); ++i) {
      out.quantile.at(i).push_back(at.q.at(i));
      out.by_inverse_freedom.at(i).push_back(std.at(i) * at.by_inverse_freedom.at(i));
    }
    out.by_skewness.push_back(p.barrier_log_std * at.by_skewness);
    out.weight.push_back(node.weight);
  }
  return out;
}

Domains make_domains(const Material& material, const Polycrystal& polycrystal, int count, std::uint64_t shift,
                     bool every_spread) {
  return domains_on(make_lattice(material, polycrystal, count, shift, every_spread), material, polycrystal);
}

}  // namespace ferrobench::model

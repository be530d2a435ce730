#include "model/physics/domains.h"

#include <Eigen/Dense>
#include <array>
#include <cmath>
#include <numeric>

namespace ferrobench::model {
namespace {

using Vector = Eigen::Vector3d;

// Lattice vectors as columns, for a cell of unit volume.
Eigen::Matrix3d lattice(int dimensions) {
  Eigen::Matrix3d basis = Eigen::Matrix3d::Identity();
  if (dimensions == 2) {
    const double a = std::sqrt(2 / std::sqrt(3.0));
    basis.col(0) = Vector(a, 0, 0);
    basis.col(1) = Vector(a / 2, a * std::sqrt(3.0) / 2, 0);
  } else if (dimensions == 3) {
    const double a = std::cbrt(2.0);
    basis.col(0) = Vector(-a / 2, a / 2, a / 2);
    basis.col(1) = Vector(a / 2, -a / 2, a / 2);
    basis.col(2) = Vector(a / 2, a / 2, -a / 2);
  }
  return basis;
}

// Turned by irrational angles, so that the nodes' projections on each axis are spread evenly.
Eigen::Matrix3d turned(int dimensions) {
  const double golden = (std::sqrt(5.0) - 1) / 2, silver = std::sqrt(2.0) - 1, root3 = std::sqrt(3.0) - 1;
  if (dimensions == 2) return Eigen::AngleAxisd(golden, Vector::UnitZ()).toRotationMatrix();
  if (dimensions == 3)
    return (Eigen::AngleAxisd(golden, Vector::UnitZ()) * Eigen::AngleAxisd(silver, Vector::UnitY()) *
            Eigen::AngleAxisd(root3, Vector::UnitX()))
        .toRotationMatrix();
  return Eigen::Matrix3d::Identity();
}

double ball_volume(int dimensions, double radius) {
  constexpr double pi = 3.14159265358979323846;
  if (dimensions == 1) return 2 * radius;
  if (dimensions == 2) return pi * radius * radius;
  return 4.0 / 3.0 * pi * radius * radius * radius;
}

}  // namespace

int spread_dimensions(const Polycrystal& p) {
  return static_cast<int>(p.barrier_log_std != 0) + static_cast<int>(p.interaction_field_std != 0) +
         static_cast<int>(p.interaction_stress_std != 0);
}

int domains_for(const Polycrystal& p, double tolerance) {
  switch (spread_dimensions(p)) {
    case 0: return 1;
    case 1: return std::max(32, static_cast<int>(0.7 / std::sqrt(tolerance)) * 4);
    case 2: return std::max(96, static_cast<int>(10 / std::sqrt(tolerance)));
    default: return std::max(128, static_cast<int>(16 / std::sqrt(tolerance)));
  }
}

Domains make_domains(const Material& material, const Polycrystal& p, int count, std::uint64_t shift) {
  const int dimensions = p.method == PolycrystalMethod::distribution ? spread_dimensions(p) : 0;
  std::vector<Vector> nodes;
  if (dimensions == 0 || count <= 1) {
    nodes.emplace_back(Vector::Zero());
  } else {
    const double radius = count < 400 ? 4.0 : 4.5;
    const double spacing = std::pow(ball_volume(dimensions, radius) / count, 1.0 / dimensions);
    const Eigen::Matrix3d basis = spacing * (turned(dimensions) * lattice(dimensions));
    // Shifts by multiples of the golden ratio's higher-dimensional kin are spread evenly over the cell.
    Vector offset = Vector::Zero();
    const std::array<double, 3> step{0.8191725133961645, 0.6710436067037893, 0.5497004779019703};
    for (int i = 0; i < dimensions; ++i)
      offset[i] = std::fmod(0.5 + step.at(static_cast<std::size_t>(i)) * static_cast<double>(shift % 1000003), 1.0);
    // Along each lattice vector the ball spans radius times the length of the inverse basis's row.
    const Eigen::Matrix3d inverse = basis.inverse();
    const auto reach = [&](int row) { return row < dimensions ? static_cast<int>(std::ceil(radius * inverse.row(row).norm())) + 1 : 0; };
    for (int i = -reach(0); i <= reach(0); ++i)
      for (int j = -reach(1); j <= reach(1); ++j)
        for (int k = -reach(2); k <= reach(2); ++k) {
          const Vector z = basis * (Vector(i, j, k) + offset);
          if (z.head(dimensions).squaredNorm() <= radius * radius) nodes.push_back(z);
        }
  }

  Domains out;
  double total = 0;
  for (const auto& z : nodes) {
    int next = 0;
    const auto coordinate = [&](double std) { return std != 0 && dimensions > 0 ? z[next++] : 0.0; };
    const double z1 = coordinate(p.barrier_log_std), z2 = coordinate(p.interaction_field_std),
                 z3 = coordinate(p.interaction_stress_std);
    out.barrier.push_back(material.barrier * std::exp(p.barrier_log_std * z1));
    out.field.push_back(p.bias_field + p.interaction_field_std * z2);
    out.stress.push_back(p.interaction_stress_std * z3);
    out.weight.push_back(std::exp(-0.5 * (z1 * z1 + z2 * z2 + z3 * z3)));
    total += out.weight.back();
  }
  for (auto& w : out.weight) w /= total;
  return out;
}

}  // namespace ferrobench::model

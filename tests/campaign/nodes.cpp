#include "tests/campaign/nodes.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace ferrobench::campaign {
namespace {

struct Point {
  double z = 0, weight = 1;
};
using Rule = std::vector<Point>;

// Gauss's rule for the standard normal: roots of He_n by Newton's method, each started beyond the last.
Rule gauss_hermite(int n) {
  const auto value = [n](double x, double* slope) {
    double before = 0, now = 1;
    for (int k = 0; k < n; ++k) {
      const double next = x * now - k * before;
      before = now;
      now = next;
    }
    *slope = n * before;
    return now;
  };
  Rule out;
  double factorial = 1;
  for (int k = 2; k < n; ++k) factorial *= k;
  // Deflated by the roots found, so that the search from above meets each of them in turn.
  double x = 2 * std::sqrt(n + 1.0);
  for (int i = 0; i < n; ++i) {
    for (int round = 0; round < 200; ++round) {
      double slope = 0;
      const double f = value(x, &slope);
      double poles = 0;
      for (const auto& found : out) poles += 1 / (x - found.z);
      const double step = f / (slope - f * poles);
      x -= step;
      if (std::abs(step) < 1e-14) break;
    }
    double slope = 0;
    value(x, &slope);
    out.push_back({x, factorial * n * n / (slope * slope)});
    x -= 1e-3;
  }
  double total = 0;
  for (const auto& p : out) total += p.weight;
  for (auto& p : out) p.weight /= total;
  return out;
}

// Evenly spaced, weighted by the normal density; `offset` in spacings.
Rule line(int n, double offset) {
  Rule out;
  const double spacing = 9.0 / n;
  double total = 0;
  for (int i = 0; i < n; ++i) {
    const double z = -4.5 + spacing * (i + offset);
    out.push_back({z, std::exp(-0.5 * z * z)});
    total += out.back().weight;
  }
  for (auto& p : out) p.weight /= total;
  return out;
}

}  // namespace

Nodes draw_nodes(const model::Material& m, const model::Polycrystal& p, int count) {
  const bool distributed = p.method == model::PolycrystalMethod::distribution;
  const double bias = distributed ? p.bias_field : 0;
  const std::array<double, 3> spread{distributed ? p.barrier_log_std : 0,
                                     distributed ? p.interaction_field_std : 0,
                                     distributed ? p.interaction_stress_std : 0};
  // What each spread contributes to the driving force: the line runs along the widest.
  const std::array<double, 3> reach{spread[0] * 4 * m.barrier, spread[1] * m.remanent_polarization,
                                    spread[2] * std::abs(m.remanent_strain_90)};
  std::array<std::size_t, 3> axes{0, 1, 2};
  std::sort(axes.begin(), axes.end(), [&](auto a, auto b) { return reach.at(a) > reach.at(b); });
  if (reach.at(axes[0]) == 0) return {{m.barrier}, {bias}, {0}, {1}};
  // Partly switched states are not smooth along the other spreads: 8 x 6 leaves 1e-3 of the range there,
  // however many points a line has. Few nodes must do with it, as lines need some twenty points each.
  const bool many = count >= 6000;
  const Rule second = reach.at(axes[1]) > 0 ? gauss_hermite(many ? 16 : 8) : Rule{Point{}};
  const Rule third = reach.at(axes[2]) > 0 ? gauss_hermite(many ? 12 : 6) : Rule{Point{}};
  const auto lines = static_cast<int>(second.size() * third.size());
  Nodes out;
  double offset = 0.25;
  for (const auto& b : second)
    for (const auto& c : third) {
      // The lines are staggered by the golden section, so that together they cut any plane evenly.
      offset = std::fmod(offset + 0.6180339887498949, 1.0);
      for (const auto& a : line(std::max(2, count / lines), offset)) {
        std::array<double, 3> z{};
        z.at(axes[0]) = a.z;
        z.at(axes[1]) = b.z;
        z.at(axes[2]) = c.z;
        out.barrier.push_back(m.barrier * std::exp(spread[0] * z[0]));
        out.field.push_back(bias + spread[1] * z[1]);
        out.stress.push_back(spread[2] * z[2]);
        out.weight.push_back(a.weight * b.weight * c.weight);
      }
    }
  return out;
}

}  // namespace ferrobench::campaign

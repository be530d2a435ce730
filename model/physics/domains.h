// The domains that stand for the polycrystal's distribution (4.57, 4.58, table 4.1), as nodes and weights.
//
//   dg0 = barrier exp(barrier_log_std q1)      E_int = bias_field + interaction_field_std q2
//   sigma_int = interaction_stress_std q3      q_i = z_i, independent standard normal
//
// With a SpreadShape q1 is Tukey's g distribution of skewness g (Hoaglin 1985), and all are Student's t with
// 1 / f degrees of freedom, in Wallace's (1959) closed form: normal for f = 0, Lorentzian for f = 1.
//
//   q1 = (exp(g z1) - 1) / g tail(z1)      q2 = z2 tail(z2), q3 likewise
//   tail(z) = sqrt((exp(c^2 f z^2) - 1) / (f z^2)),   c = (8 + 3 f) / (8 + f)
//
// Of t's own quantiles these are within 0.6 % up to |z| = 2 and 3 % up to 3 for f = 1/4, within 5 and 25 %
// for 1/2.
//
// A domain's answer is nearly a step in z, so rules made for smooth functions gain nothing. The nodes are a
// lattice (line, centred rectangular, body-centred, by the number of spreads that are not zero) in a ball,
// weighted by the Gaussian density; the lattice is stretched so that the planes across which domains switch
// cut it evenly. Error in P and strain, rms over their range, against 60,000 nodes: 256 nodes 1e-3, 1,024
// nodes 2e-4 or better (three spreads). Different shifts of the lattice give independent estimates of the
// same mean.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "model/model.h"

namespace ferrobench::model {

struct SpreadShape {
  double skewness = 0;         // of ln(dg0) alone: above zero, the high barriers reach farther
  double inverse_freedom = 0;  // of all three spreads, not below zero
};

struct Domains {
  std::vector<double> barrier;  // J/m^3
  std::vector<double> field;    // E_int, V/m
  std::vector<double> stress;   // sigma_int, Pa
  std::vector<double> weight;   // sums to 1
  std::size_t size() const { return weight.size(); }
};

// Columns by spread: barriers, fields, stresses.
using SpreadColumns = std::array<std::vector<double>, 3>;

// How the domains move with their spreads, for sensitivities.
struct SpreadSlopes {
  SpreadColumns quantile;            // q: by the standard deviations
  std::vector<double> by_skewness;   // ln(dg0)
  SpreadColumns by_inverse_freedom;  // ln(dg0), V/m, Pa
  std::vector<double> weight;        // of the domains
  std::size_t size() const { return weight.size(); }
};

// The nodes in z, where they stand for all models alike.
struct Lattice {
  struct Node {
    double z1 = 0, z2 = 0, z3 = 0;  // zero where there is no spread
    double weight = 0;
  };
  std::vector<Node> nodes;
};

// About `count` nodes (one if no spread is set). `shift` picks one of the lattice's shifts. `every_spread`:
// the lattice is that of three spreads and nodes that differ only in spreads of zero become one, so that the
// quadrature's error does not jump where a spread is switched on.
Lattice make_lattice(const Material& material, const Polycrystal& polycrystal, int count, std::uint64_t shift,
                     bool every_spread = false);
Domains domains_on(const Lattice& lattice, const Material& material, const Polycrystal& polycrystal,
                   const SpreadShape& shape = {});
SpreadSlopes spread_slopes_on(const Lattice& lattice, const Polycrystal& polycrystal,
                              const SpreadShape& shape);
// Both.
Domains make_domains(const Material& material, const Polycrystal& polycrystal, int count, std::uint64_t shift,
                     bool every_spread = false);

// The number of spreads that are not zero.
int spread_dimensions(const Polycrystal& polycrystal);

// Nodes that keep the quadrature's error in P and strain, rms over their range, below `tolerance`.
// More where the spreads are wide against kT, as a domain's answer is then sharper.
int domains_for(const Material& material, const Polycrystal& polycrystal, double tolerance);

}  // namespace ferrobench::model

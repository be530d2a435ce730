// The domains of the twin, another quadrature than the model's own: Sobol's sequence through the
// inverse of the normal distribution, with equal weights. Powers of two are the best counts.
#pragma once

#include <vector>

#include "tests/campaign/terms.h"

namespace ferrobench::campaign {

struct Nodes {
  std::vector<double> barrier;  // J/m^3
  std::vector<double> field;    // V/m
  std::vector<double> stress;   // Pa
  std::vector<double> weight;   // sums to 1
  std::vector<double> pace;     // factor on the rates; empty: 1
};

// `count` nodes; one if there is no spread. Of the terms those that spread otherwise.
Nodes draw_nodes(const model::Material& material, const model::Polycrystal& polycrystal, int count,
                 const Terms& terms);

}  // namespace ferrobench::campaign

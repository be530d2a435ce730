// The domains of the twin, another quadrature than the model's own: Sobol's sequence through the
// inverse of the normal distribution, with equal weights. Powers of two are the best counts.
#pragma once

#include <vector>

#include "model/model.h"

namespace ferrobench::campaign {

struct Nodes {
  std::vector<double> barrier;  // J/m^3
  std::vector<double> field;    // V/m
  std::vector<double> stress;   // Pa
  std::vector<double> weight;   // sums to 1
};

// `count` nodes; one if there is no spread.
Nodes draw_nodes(const model::Material& material, const model::Polycrystal& polycrystal, int count);

}  // namespace ferrobench::campaign

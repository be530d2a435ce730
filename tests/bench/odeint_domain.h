// One domain by Boost.odeint's rosenbrock4 with dense output.
#pragma once

#include <vector>

#include "tests/bench/program.h"

namespace ferrobench::bench {

// As in model/physics/wells.h, and the domain's own barrier, internal field and stress.
struct OdeintDomain {
  double polarization, strain_90, piezoelectric, half_permittivity, half_compliance, inverse_energy,
      relaxation_time;
  double barrier, field, stress, weight;
};

// Adds weight times the fractions at every output.
void add_domain(const OdeintDomain& k, const std::vector<CreepPiece>& pieces, const StressPath& path,
                const PeerOptions& options, std::vector<double>& plus, std::vector<double>& minus);

}  // namespace ferrobench::bench

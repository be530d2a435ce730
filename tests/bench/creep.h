// The creep protocol of table 3.11 as the benchmark plays it, and what is compared: P at 50 Hz.
//
// From +1.5 kV/mm, six times: ramp at 1 kV/mm/s to 0, -0.45, -0.5, -0.55, -0.8, -1.5 kV/mm, hold 15 s, ramp
// back to +1.5, hold 5 s. Prestress 8 MPa; 1,024 domains asked for, as many as the lattice has near that.
#pragma once

#include <vector>

#include "model/model.h"
#include "model/physics/domains.h"
#include "tests/bench/program.h"

namespace ferrobench::bench {

struct Creep {
  model::Model model;
  model::Domains domains;
  std::vector<CreepPiece> pieces;
  std::size_t outputs = 0;
};
Creep make_creep(double spring_stiffness, double output_rate = 50, int nodes = 1024);

// What a run gives, at every output.
struct Outputs {
  std::vector<double> polarization;  // C/m^2
  std::vector<double> stress;        // Pa
};

double polarization(const model::Material& m, double field, double stress, double plus, double minus);

// Root of the mean square of a - b over the range of b.
double rms_over_range(const std::vector<double>& a, const std::vector<double>& b);

}  // namespace ferrobench::bench

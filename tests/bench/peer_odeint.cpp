#include "tests/bench/peer_odeint.h"

#include "model/physics/wells.h"
#include "tests/bench/odeint_domain.h"

namespace ferrobench::bench {

Outputs run_rosenbrock4(const Creep& creep, const StressPath& path, const PeerOptions& options) {
  std::vector<double> plus(creep.outputs, 0.0), minus(creep.outputs, 0.0);
  const auto k = model::kinetic_constants(creep.model.material);
  const auto& d = creep.domains;
  for (std::size_t i = 0; i < d.size(); ++i)
    add_domain({k.polarization, k.strain_90, k.piezoelectric, k.half_permittivity, k.half_compliance,
                k.inverse_energy, k.relaxation_time, d.barrier[i], d.field[i], d.stress[i], d.weight[i]},
               creep.pieces, path, options, plus, minus);
  Outputs out;
  std::size_t row = 0;
  for (std::size_t p = 0; p < creep.pieces.size(); ++p) {
    const auto& piece = creep.pieces[p];
    for (const double t : piece.times) {
      const double e = piece.from + piece.slope() * (t - piece.start), s = path.at(p, t).stress;
      out.stress.push_back(s);
      out.polarization.push_back(polarization(creep.model.material, e, s, plus[row], minus[row]));
      ++row;
    }
  }
  return out;
}

}  // namespace ferrobench::bench

#include "tests/bench/creep.h"

#include <algorithm>
#include <cmath>

namespace ferrobench::bench {

Creep make_creep(double spring_stiffness, double output_rate, int nodes) {
  Creep out;
  out.model = model::library_model("soft-pzt");
  out.model.load = {.spring_stiffness = spring_stiffness, .prestress = 8e6};
  out.domains = model::make_domains(out.model.material, out.model.polycrystal, nodes, 0);
  constexpr double rest = 1.5e6, rate = 1e6;
  double time = 0;
  std::size_t sample = 0;
  const auto add = [&](double duration, double from, double to) {
    CreepPiece piece{.start = time, .duration = duration, .from = from, .to = to, .times = {}};
    time += duration;
    for (double next = 0; (next = static_cast<double>(sample + 1) / output_rate) <= time + 1e-9; ++sample)
      piece.times.push_back(std::min(next, time));
    out.outputs += piece.times.size();
    out.pieces.push_back(std::move(piece));
  };
  for (const double level : {0.0, -0.45e6, -0.5e6, -0.55e6, -0.8e6, -1.5e6}) {
    add((rest - level) / rate, rest, level);
    add(15, level, level);
    add((rest - level) / rate, level, rest);
    add(5, rest, rest);
  }
  return out;
}

double polarization(const model::Material& m, double field, double stress, double plus, double minus) {
  const double permittivity =
      m.permittivity_180 + (m.permittivity_90 - m.permittivity_180) * (1 - plus - minus);
  return permittivity * field + (m.piezoelectric_180 * stress + m.remanent_polarization) * (plus - minus);
}

double rms_over_range(const std::vector<double>& a, const std::vector<double>& b) {
  double sum = 0;
  for (std::size_t i = 0; i < b.size(); ++i) sum += (a.at(i) - b[i]) * (a.at(i) - b[i]);
  const auto [low, high] = std::minmax_element(b.begin(), b.end());
  return std::sqrt(sum / static_cast<double>(b.size())) / (*high - *low);
}

}  // namespace ferrobench::bench

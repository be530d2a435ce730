#include "model/inference/report/moved_parameters.h"

#include <fmt/format.h>

#include <cmath>

#include "model/inference/parameters/scaled_parameters.h"

namespace ferrobench::model {

std::vector<std::string> moved_parameters(const Discovery& d) {
  std::vector<std::string> out;
  bool of_model_alone = true;
  for (const auto& [path, r] : d.recalibrated) {
    if (std::abs(r.to - r.from) < 2 * r.std) continue;
    const double share = r.from == 0 ? 1 : r.to / r.from - 1;
    if (std::abs(share) < 0.005) continue;
    out.push_back(r.from == 0 ? fmt::format("{} {:.4g} ± {:.2g}", path, r.to, r.std)
                              : fmt::format("{} {:+.1f} % ({:.4g} to {:.4g}, ± {:.2g})", path, 100 * share,
                                            r.from, r.to, r.std));
    of_model_alone = of_model_alone && inference::is_of_model(path);
  }
  if (!of_model_alone)
    out.emplace_back(
        "Gains, offsets and factors are those of the instruments and the load. The improved model is that of "
        "the "
        "specimen, without them.");
  return out;
}

std::vector<std::string> astonishing_moves(const Discovery& d) {
  constexpr double astonishing = 3;  // standard deviations of the prior
  std::vector<std::string> out;
  for (const auto& [path, r] : d.recalibrated)
    if (std::abs(r.over_prior) > astonishing)
      out.push_back(fmt::format(
          "{} went from {:.4g} to {:.4g}, {:.1f} standard deviations of what was known of it: check the "
          "instrument, or what the model states.",
          path, r.from, r.to, std::abs(r.over_prior)));
  return out;
}

}  // namespace ferrobench::model

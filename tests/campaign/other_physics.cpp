#include "tests/campaign/other_physics.h"

#include <algorithm>
#include <array>

namespace ferrobench::campaign {

std::span<const Outsider> other_physics() {
  using model::Family;
  using enum model::Sign;
  static const std::vector<Outsider> all{
      {.id = "barrier_exponent",
       .equation = "dg = dg0 (1 - |F| / (4 dg0))^(2 + change) + max(0, -F), which keeps the detailed balance",
       .family = Family::kinetics,
       .parameters = {{"change", "1", 1e-4, 0.15, any}}},
      {.id = "heavy_tails",
       .equation =
           "the spreads' normal quantiles become Student's t with 1 / inverse_freedom degrees of freedom",
       .family = Family::kinetics,
       .parameters = {{"inverse_freedom", "1", 1e-3, 0.4, above_zero}}},
      outsider("switching_asymmetry"),
      {.id = "direct_180_switching",
       .equation = "+ <-> - at once: rate_ratio / tau exp(-dg(F) V / (k T)), F = g_+ - g_-, dg0 times "
                   "barrier_ratio",
       .family = Family::kinetics,
       .parameters = {{"rate_ratio", "1", 1e-7, 1e2, above_zero},
                      {"barrier_ratio", "1", 1.2, 1.8, above_zero}}},
      {.id = "stretched_waiting",
       .equation =
           "at constant loads each barrier is waited for as exp(-(t / t0)^(1 - deficit)): the domains' "
           "rates times factors of a one-sided stable law",
       .family = Family::kinetics,
       .parameters = {{"deficit", "1", 1e-3, 0.6, above_zero}}},
      {.id = "spring_hysteresis",
       .equation = "F_spring = k (x + width z), z Dahl's state over distance",
       .family = Family::equilibrium,
       .parameters = {{"width", "m", 1e-10, 3e-6, above_zero}, {"distance", "m", 1e-6, 1e-5, above_zero}}}};
  return all;
}

std::string_view collision(std::string_view physics, std::string_view effect) {
  struct Pair {
    std::string_view physics, effect, reason;
  };
  static constexpr std::array<Pair, 6> pairs{
      {{"heavy_tails", "barrier_distribution", "the spread whose tails are heavy would be the effect"},
       {"heavy_tails", "interaction_field_distribution",
        "the spread whose tails are heavy would be the effect"},
       {"stretched_waiting", "barrier_distribution", "a spread of barriers is a spread of waiting times"},
       {"switching_asymmetry", "internal_bias_field", "unequal barriers shift the loop as a bias field does"},
       {"spring_hysteresis", "guide_friction", "it is the same force, but for the load cell"},
       {"spring_hysteresis", "contact_gap", "what a hysteretic spring does once lifted is not defined"}}};
  const auto found =
      std::ranges::find_if(pairs, [&](const Pair& p) { return p.physics == physics && p.effect == effect; });
  return found == pairs.end() ? std::string_view() : found->reason;
}

}  // namespace ferrobench::campaign

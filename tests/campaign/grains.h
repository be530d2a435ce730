// Rates and phase fractions of all domains over one step of the twin.
//
// The rates are averaged over the step by Gauss's rule in two points, then the three-state chain is advanced
// by its exact exponential. Second order in time.
#pragma once

#include "tests/campaign/nodes.h"

namespace ferrobench::campaign {

struct RateLaw {
  double polarization = 0;                     // P_+, C/m^2
  double strain_90 = 0;                        // eps_90
  double piezoelectric = 0;                    // m/V
  double permittivity_step = 0;                // kappa_180 - kappa_90, F/m
  double compliance_step = 0;                  // s_180 - s_90, 1/Pa
  double inverse_energy = 0;                   // V / (k T), m^3/J
  double attempt_rate = 0;                     // 1 / tau, 1/s
  double stabilization = 0;                    // barrier of 90 -> +/- times 1 + this * max(0, -sigma)
  double rising = 1, falling = 1;              // factors on the barriers of switching towards + and towards -
  double exponent = 2;                         // of the barrier over the driving force
  double direct_rate = 0, direct_barrier = 1;  // of + <-> -, over those of 90
};

struct Grains {
  explicit Grains(const Nodes& nodes);
  std::vector<double> barrier, field, stress, weight;
  bool paced;                // whether the rates differ by
  std::vector<double> pace;  // this factor
  std::vector<double> plus, minus, next_plus, next_minus;
};

struct LoadPoint {
  double field = 0, stress = 0;
};
struct MeanFractions {
  double plus = 1, minus = 0;
};

// From plus, minus to next_plus, next_minus under the loads at both Gauss points of a step of h seconds.
MeanFractions advance(const RateLaw& law, Grains& grains, double h, const LoadPoint& early,
                      const LoadPoint& late);

}  // namespace ferrobench::campaign

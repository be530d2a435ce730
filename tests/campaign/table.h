// The figures of a campaign against their goals, and how far stated probabilities can be believed.
#pragma once

#include <limits>

#include "tests/campaign/score.h"

namespace ferrobench::campaign {

struct Figure {
  std::string name;
  double value = std::numeric_limits<double>::quiet_NaN();
  double goal = 0;
  bool at_least = true;   // else at most
  std::size_t count = 0;  // benches behind it
  bool met() const { return at_least ? value >= goal : value <= goal; }
};
std::vector<Figure> figures(const std::vector<Outcome>& outcomes);

// Verdicts by stated probability. Most are surer than 0.9, so the last tenth is divided.
struct Reliability {
  static constexpr std::array edges{0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.99, 1.0};
  struct Bin {  // from edges[i] to below edges[i + 1], the last with its end
    std::size_t count = 0;
    double stated = 0, right = 0;  // means
  };
  std::array<Bin, edges.size() - 1> bins;
  double expected_calibration_error = 0, brier = 0;
};
Reliability reliability(const std::vector<Outcome>& outcomes);

std::string text_of(const std::vector<Outcome>& outcomes);
nlohmann::json json_of(const std::vector<Outcome>& outcomes);

}  // namespace ferrobench::campaign

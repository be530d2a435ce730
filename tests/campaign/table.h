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

// Verdicts by stated probability, in tenths.
struct Reliability {
  struct Bin {
    std::size_t count = 0;
    double stated = 0, right = 0;  // means
  };
  std::array<Bin, 10> bins;
  double expected_calibration_error = 0, brier = 0;
};
Reliability reliability(const std::vector<Outcome>& outcomes);

std::string text_of(const std::vector<Outcome>& outcomes);
nlohmann::json json_of(const std::vector<Outcome>& outcomes);

}  // namespace ferrobench::campaign

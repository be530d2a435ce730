// Rows unevenly spaced: two holds of 600 s at 1.2 and 0.4 with 20 readings a decade, and 30 pulses at 1 kHz,
// which have nearly all of the rows.
#pragma once

#include <cmath>
#include <vector>

namespace ferrobench::recordings::testing {

struct UnevenRows {
  static constexpr double hold = 600, level[] = {1.2, 0.4};
  std::vector<double> time, field;

  UnevenRows() {
    const auto add = [this](double t, double value) {
      time.push_back(t);
      field.push_back(value);
    };
    double start = 0;
    for (int k = 0; k < 2; ++k) {
      for (int i = 0; i < 24; ++i) add(start + i * 1e-3, level[k] + (k == 0 ? -1.2 : 0.8) * (1 - i / 24.));
      for (double since = 0.024; since < hold; since *= std::pow(10, 1 / 20.)) add(start + since, level[k]);
      add(start + hold - 1e-3, level[k]);
      start += hold;
    }
    for (int i = 0; i < 30 * 440; ++i) add(start + i * 1e-3, i % 440 < 220 ? 1 : 0);
  }
  // The level of the hold at t, NaN within `beside` of a ramp and later.
  double level_at(double t, double beside) const {
    for (int k = 0; k < 2; ++k)
      if (t > k * hold + beside && t < (k + 1) * hold - beside) return level[k];
    return NAN;
  }
};

}  // namespace ferrobench::recordings::testing

// A single crystal that switches within a second, and programs for it.
#pragma once

#include <cmath>
#include <string>
#include <string_view>
#include <vector>

#include "model/effects/catalogue.h"
#include "model/simulator.h"

namespace ferrobench::model {

using Parameters = std::vector<std::pair<std::string, double>>;

inline Model crystal() {
  Model m;
  m.material.permittivity_90 = 3e-8;
  m.material.compliance_90 = 2.2e-11;
  m.load = {.spring_stiffness = 2.7e6, .prestress = 8e6};
  return m;
}

// Whether an effect is about the shape of spreads, and shows nothing without any.
inline bool shapes_spreads(std::string_view id) {
  return id == "empirical_skewness" || id == "empirical_tails";
}

inline Model with(Model m, const std::string& id, const Parameters& parameters) {
  m.effects.push_back({id, parameters});
  return m;
}

struct Program {
  std::vector<double> time, field;
  // Corners, sampled every `step`.
  Program(std::vector<std::pair<double, double>> corners, double step) {
    for (std::size_t i = 0; i + 1 < corners.size(); ++i) {
      const auto [t0, e0] = corners[i];
      const auto [t1, e1] = corners[i + 1];
      const int n = static_cast<int>(std::lround((t1 - t0) / step));
      for (int j = 0; j < n; ++j) {
        time.push_back(t0 + (t1 - t0) * j / n);
        field.push_back(e0 + (e1 - e0) * j / n);
      }
    }
    time.push_back(corners.back().first);
    field.push_back(corners.back().second);
  }
};

inline Program loop() {
  return {{{0, 0}, {0.1, -2e6}, {0.3, 2e6}, {0.4, 0}, {0.5, 0}}, 1e-3};
}
inline Program unipolar() {
  return {{{0, 0}, {0.1, 2e6}, {0.2, 0}}, 1e-3};
}
inline Program held() {
  return {{{0, 0}, {0.05, -1.2e6}, {1.05, -1.2e6}, {1.1, 0}}, 2e-3};
}
inline Program rest() {
  return {{{0, 0}, {1, 0}}, 1e-2};
}

inline Trajectory run(const Model& m, const Program& p) {
  return simulate(m, p.time, p.field);
}

// rms difference over the range of `a`.
inline double apart(const std::vector<double>& a, const std::vector<double>& b) {
  double sum = 0, low = a[0], high = a[0];
  for (std::size_t i = 0; i < a.size(); ++i) {
    sum += (a[i] - b[i]) * (a[i] - b[i]);
    low = std::min(low, a[i]);
    high = std::max(high, a[i]);
  }
  return std::sqrt(sum / static_cast<double>(a.size())) / (high - low);
}

}  // namespace ferrobench::model

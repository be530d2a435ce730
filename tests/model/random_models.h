// Random models and field programs in a plausible range of soft and hard PZT.
#pragma once

#include <random>

#include "tests/model/effects_support.h"

namespace ferrobench::model {

class Draw {
 public:
  explicit Draw(unsigned seed) : generator_(seed) {}
  double between(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(generator_);
  }
  double decades(double low, double high) { return std::exp(between(std::log(low), std::log(high))); }
  bool coin() { return between(0, 1) < 0.5; }

  Model model() {
    Model m;
    auto& a = m.material;
    a.remanent_polarization = between(0.2, 0.4);
    a.remanent_strain_90 = -decades(1e-3, 6e-3);
    a.permittivity_180 = between(1e-8, 4e-8);
    a.permittivity_90 = between(1e-8, 4e-8);
    a.compliance_180 = between(1e-11, 2e-11);
    a.compliance_90 = between(1e-11, 2e-11);
    a.piezoelectric_180 = between(2e-10, 8e-10);
    a.barrier = decades(2e4, 8e4);
    a.relaxation_time = decades(1e-6, 1e-1);
    a.activation_volume = decades(1e-24, 5e-24);
    a.barrier_law = coin() ? BarrierLaw::equal_curvature : BarrierLaw::unequal_curvature;
    m.polycrystal.method = PolycrystalMethod::distribution;
    m.polycrystal.barrier_log_std = between(0.1, 0.5);
    m.polycrystal.interaction_field_std = between(5e4, 2e5);
    m.polycrystal.interaction_stress_std = between(2e6, 2e7);
    m.polycrystal.bias_field = between(0, 2e5);
    m.load = {.spring_stiffness = between(0, 6e6), .prestress = between(0, 16e6)};
    return m;
  }

  // A loop to both ends, so that the range is that of a switching loop, then corners anywhere.
  Program program() {
    std::vector<std::pair<double, double>> corners{{0, 0}};
    const double rate = decades(5e5, 2e7);
    const auto go = [&](double level) {
      const auto [t, from] = corners.back();
      corners.emplace_back(t + std::max(0.05, std::abs(level - from) / 1e6) * 1e6 / rate, level);
    };
    go(-2e6);
    go(2e6);
    for (int i = 0; i < 3; ++i) go(between(-2e6, 2e6));
    corners.emplace_back(corners.back().first + between(0.1, 5), corners.back().second);
    return {corners, corners.back().first / 500};
  }

 private:
  std::mt19937 generator_;
};

}  // namespace ferrobench::model
